"""What is written while a simulation runs."""
