"""Matrix-free operators and their preconditioners: C code and its Python callers.

``cells`` lays out the cells of a rank and exchanges ghosts. ``product`` is the matrix-free stiffness, ``pressure`` the
matrix-free blocks of mixed elements. ``assembly`` assembles the matrices that need entries: degree 1 and direct solves.
``multigrid`` is a cycle over degrees in single precision, ``native`` the compiled library.
"""
