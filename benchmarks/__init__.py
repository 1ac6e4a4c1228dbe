"""Measurements of speed and of accuracy, each in one run on one machine: ratios, not seconds, are what they say."""
