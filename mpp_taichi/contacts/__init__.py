"""Contacts of hard spheres, one solver per file."""
