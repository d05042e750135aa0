"""Physics in plain NumPy, written independently of the program, for comparison with its results."""
