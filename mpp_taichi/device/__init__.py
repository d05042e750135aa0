"""The machine: which backends start, what they can do, and copies to and from fields."""
