"""Contacts located on the paths of an adaptive method's steps."""
