"""The reason that gmsh gives for a failure."""

import gmsh

_OF_MEMORY = "bad_alloc"


def reason(error: Exception) -> str:
    """Return gmsh's message of an ``error``.

    Raises:
        MemoryError: if memory has run out, which no other mesh helps; gmsh then gives that reason or none.
    """
    reason = str(error) or gmsh.logger.getLastError()
    if isinstance(error, MemoryError) or not reason or _OF_MEMORY in reason:
        raise MemoryError(f"gmsh: {reason or 'gives no reason: memory may have run out'}") from error
    return reason
