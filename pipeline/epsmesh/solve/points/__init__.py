"""Values of a solution at points: the cells that have the points, and strain, stress and what follows from them."""
