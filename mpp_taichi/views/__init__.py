"""Views: the pictures that are shown while a simulation runs."""
