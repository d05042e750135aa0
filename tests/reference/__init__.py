"""Plain NumPy physics, written apart from the program, to hold it against."""
