"""Integrators, one per file."""
