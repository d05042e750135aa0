"""Passport: what a file came from, inside the file: scene, versions, machine, and the verdict of `verify` on this machine."""
