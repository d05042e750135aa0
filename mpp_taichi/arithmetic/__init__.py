"""Arithmetic on the numbers of particles: updates with low parts, inverse distances, cubic interpolation."""
