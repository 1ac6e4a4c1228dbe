"""Bodies, probes and cuts as a gmsh CAD model with named groups. Knows nothing of PETSc."""
