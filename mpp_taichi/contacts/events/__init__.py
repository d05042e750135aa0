"""Event-driven spheres: cells, predictions, queue and collisions."""
