"""Solvers of the equations of an implicit step: Newton's method, and what solves its linear systems."""
