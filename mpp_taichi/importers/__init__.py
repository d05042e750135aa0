"""Importers: what other programs wrote, as a scene; one file each with `SUFFIXES`, `recognises(text)`, `read(text, source)`."""
