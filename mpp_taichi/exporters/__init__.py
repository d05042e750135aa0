"""Exporters: files of particles for other programs; one module for each format.

An exporter has `SUFFIXES`, and `text(source)`, which gives the whole text, or `write(source, path)`; `HOLDS_FRAMES = True`
says that it writes all of `source.frames()`.
"""
