"""Insertion of a tool: indentation, puncture and cutting, from solved states of a body with and without a slit."""
