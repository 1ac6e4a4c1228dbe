"""Size field, mesh generation, curved elements and distribution. Knows nothing of elasticity."""
