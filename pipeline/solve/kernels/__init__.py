"""Operators cell by cell, and what preconditions them: C code and what calls it.

``cells`` lays out the cells of a rank, and exchanges values between ranks; ``product`` multiplies with the stiffness,
``pressure`` with what mixed elements add to it. ``assembly`` makes the few matrices that need entries: degree 1 and
direct solves. ``multigrid`` is a cycle in single precision over degrees, ``native`` the compiled library.
"""
