"""Execution under MPI: case store, records, progress. Knows nothing of plots."""
