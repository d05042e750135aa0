"""Backends side by side: a certificate that they agree, and what each of them takes in time."""
