"""The machine: the backends that start, their abilities, and copies to and from fields."""
