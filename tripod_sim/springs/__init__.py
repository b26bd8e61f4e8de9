"""Bodies of particles and springs: chains, grids, cloth."""
