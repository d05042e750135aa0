"""Quantities that panels plot, one per file."""
