"""What gmsh gives as the reason of a failure."""

import gmsh


def reason(error: Exception) -> str:
    """Return what gmsh says of an ``error``; without memory it says nothing."""
    return str(error) or gmsh.logger.getLastError() or "gives no reason: memory may have run out"
