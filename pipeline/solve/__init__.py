"""Linear elasticity: operators, solvers, reaction force, checks. Knows nothing of study files."""
