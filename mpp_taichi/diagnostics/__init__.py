"""Diagnostics, one per file."""
