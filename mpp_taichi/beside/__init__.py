"""Beside: a film of one scene under two settings, side by side, with the growth of their difference."""
