"""Spheres that merge at their contact."""
