"""Fields of particles and springs."""
