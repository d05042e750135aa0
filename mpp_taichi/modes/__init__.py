"""Modes: the small vibrations of a spring network; NumPy on the host, no Taichi."""
