"""Surfaces that organs are given as: STL, PLY and OBJ files, read strictly."""
