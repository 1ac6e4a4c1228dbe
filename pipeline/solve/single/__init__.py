"""Multigrid in single precision: what a preconditioner reads is a quarter of what the operator is."""
