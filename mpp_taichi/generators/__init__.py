"""Generators of particles, one per file."""
