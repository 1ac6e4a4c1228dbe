"""Operators cell by cell, and what preconditions them: C code and what calls it.

``cells`` lays out the cells of a rank, ``product`` and ``curved`` multiply with the stiffness, ``pressure`` with what
mixed elements add to it. ``assembly`` makes the few matrices that need entries: degree 1 and direct solves.
``multigrid`` is a cycle in single precision over degrees, with ``interpolation`` between them, ``ghosts`` the exchange
of values between ranks, ``native`` the compiled library.
"""
