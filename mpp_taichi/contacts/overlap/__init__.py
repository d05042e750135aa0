"""Pairwise contacts: overlaps after a step and their removal."""
