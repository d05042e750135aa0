"""Generators of springs, one per file."""
