"""Importers: what other programs wrote, as a scene; one file each with `SUFFIXES`, `recognises(text)`, `read(text, source)`.

Where `BINARY = True` they are given bytes; with `particles(data, source)` they make a state without going by way of a scene.
"""
