"""Importers: scenes from files of other programs; one module each with `SUFFIXES`, `recognises(text)`, `read(text, source)`.

A module with `BINARY = True` is given bytes; one with `particles(data, source)` makes a state without making a scene.
"""
