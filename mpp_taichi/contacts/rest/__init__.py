"""Resting contacts: rows of constraints and the complementarity problem that they make."""
