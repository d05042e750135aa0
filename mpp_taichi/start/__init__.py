"""From a checked scene to the particles that a run starts with."""
