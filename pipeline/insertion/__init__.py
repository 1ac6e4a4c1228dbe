"""Insertion of a tool: indentation, puncture and cutting, from solved states of a body with and without a slit."""

# What the names of its files add to the study's: the dataset of the study's own cases stays.
ENDING = "_insertion"
