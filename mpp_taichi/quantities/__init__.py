"""Quantities of one sample of a run, each a number or an array, one quantity per file."""
