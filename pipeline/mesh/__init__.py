"""Size field, generation, curving and distribution of the mesh. Knows nothing of elasticity."""
