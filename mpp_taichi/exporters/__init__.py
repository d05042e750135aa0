"""Exporters: a state as the text that other programs read; one file each, with `SUFFIX` and `text(source)`."""
