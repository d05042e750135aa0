"""Wording: how messages and reports write numbers, for every room."""
