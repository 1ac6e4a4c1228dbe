"""Plane strain: what is long in one direction, and has the same section everywhere."""
