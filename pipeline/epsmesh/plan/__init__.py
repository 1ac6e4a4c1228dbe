"""What a study needs done, after everything avoidable is skipped. Knows nothing of dolfinx or gmsh."""
