"""Recorders: the files that are written while a simulation runs."""
