"""Statistical mechanics of a gas of hard disks or spheres: formulas in NumPy, each with its source."""
