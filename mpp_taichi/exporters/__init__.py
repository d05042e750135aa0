"""Exporters: particles as other programs read them; one file each.

It has `SUFFIXES`, and `text(source)`, which gives the whole text, or `write(source, path)`; `HOLDS_FRAMES = True` where it
writes all of `source.frames()`.
"""
