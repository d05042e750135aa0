"""Walls that enclose the particles, one kind per file."""
