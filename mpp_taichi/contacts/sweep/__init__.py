"""Swept contacts: islands of spheres, played in the order of their contacts within a drift."""
