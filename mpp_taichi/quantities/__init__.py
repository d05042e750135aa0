"""Quantities: what one sample of a run has, a number or an array, one per file."""
