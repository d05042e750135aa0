"""Energies of a system, their errors, and the balance along a run."""
