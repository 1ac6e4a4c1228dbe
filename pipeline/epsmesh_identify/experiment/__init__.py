"""Measured force curves: files of testing machines, read into SI units and taken apart into segments."""
