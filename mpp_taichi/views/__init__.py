"""What is shown while a simulation runs."""
