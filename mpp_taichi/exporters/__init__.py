"""Exporters: files of particles for other programs; one module for each format.

An exporter has `SUFFIXES`, and a function `text(source)`, which gives the whole text, or `write(source, path)`. An exporter
with `HOLDS_FRAMES = True` writes all of `source.frames()`.
"""
