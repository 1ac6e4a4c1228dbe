"""What a study needs done, after everything avoidable is struck out. Knows nothing of dolfinx or gmsh."""
