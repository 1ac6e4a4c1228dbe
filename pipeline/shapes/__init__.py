"""Bodies, supports and probes: one file a shape holds all that the program knows of it. Knows nothing else."""
