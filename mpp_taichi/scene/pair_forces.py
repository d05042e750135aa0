"""The forces that act between all pairs of particles, read from their files without an import of Taichi."""

from mpp_taichi import component

PAIR_CLASSES = ("PairForce", "InverseSquareForce", "FormulaPair")
"""Base classes of these forces, in `forces/_base.py`, `_inverse_square.py` and `_formula.py`."""


def is_pair_force(name: str) -> bool:
    """Whether a force of this name is summed over pairs, so that its work grows with N²."""
    return component.declaration("forces", name).base in PAIR_CLASSES
