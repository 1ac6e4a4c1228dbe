"""Meshes by gmsh, and the reason that it gives for a failure."""

import gmsh

_OF_MEMORY = "bad_alloc"
# What gmsh does at an error: it ends the mesh, or throws, as its other functions are told to.
_ENDS, _THROWS = 1, 2


def generate(dim: int) -> None:
    """Mesh gmsh's current model up to dimension ``dim``.

    While it meshes faces, an error that it throws would end the process: no one catches it in a parallel region.

    Raises:
        Exception: bare, as gmsh's own, with the message of its error.
    """
    gmsh.option.setNumber("General.AbortOnError", _ENDS)
    try:
        gmsh.model.mesh.generate(dim)
    finally:
        gmsh.option.setNumber("General.AbortOnError", _THROWS)
    if error := gmsh.logger.getLastError():
        raise Exception(error)


def reason(error: Exception) -> str:
    """Return gmsh's message of an ``error``.

    Raises:
        MemoryError: if memory has run out, which no other mesh helps; gmsh then gives that reason or none.
    """
    reason = str(error) or gmsh.logger.getLastError()
    if isinstance(error, MemoryError) or not reason or _OF_MEMORY in reason:
        raise MemoryError(f"gmsh: {reason or 'gives no reason: memory may have run out'}") from error
    return reason
