"""Axisymmetric scenes in the half plane (r, z)."""
