"""Dataset and figures. Knows nothing of dolfinx."""
