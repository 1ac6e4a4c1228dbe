"""The reason that gmsh gives for a failure."""

import gmsh


def reason(error: Exception) -> str:
    """Return gmsh's message of an ``error``, which is empty if memory has run out."""
    return str(error) or gmsh.logger.getLastError() or "gives no reason: memory may have run out"
