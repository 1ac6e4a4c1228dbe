"""Study files: schema, units, and sweeps into cases. Knows nothing of dolfinx, gmsh or MPI."""
