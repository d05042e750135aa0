"""Modes: how a spring network swings when it is disturbed a little; NumPy on the host, no Taichi."""
