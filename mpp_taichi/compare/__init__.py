"""Backends side by side: a certificate that they agree, and the time that each of them takes."""
