"""Bodies, supports and probes: one file per shape has all that the program knows about it. Imports nothing else."""
