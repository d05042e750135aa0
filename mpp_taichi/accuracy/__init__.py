"""The cost of accuracy in time: a scene run by many methods, steps and precisions, measured against a converged reference."""
