"""Solvers of the equations of an implicit step: Newton's method, and the solvers of its linear systems."""
