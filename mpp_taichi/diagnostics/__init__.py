"""Diagnostics: numbers that a whole run has, one per file; and the reductions that make such a number of any quantity."""
