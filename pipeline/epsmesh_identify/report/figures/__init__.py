"""Figures of an identification, and of Sobol's indices, drawn from their dataset alone."""
