"""Walls: what encloses the particles, one kind per file."""
