"""Strict readers of organ surfaces: STL, PLY, OBJ, label maps and CAD files."""
