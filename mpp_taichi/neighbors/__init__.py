"""How pairs of particles are found."""
