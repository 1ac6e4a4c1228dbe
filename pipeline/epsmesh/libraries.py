"""A sentence for a library that is not installed, with the command that installs it. Imports nothing of the program."""

_SOURCE = "in the project's folder"
_FENICS = f"`make setup` {_SOURCE} installs it on Debian, `conda env create -f environment.yml` elsewhere"
_PIP = "`pip install '{}'` " + _SOURCE + " installs it (on Debian: `make setup`)"
_REMEDIES = {
    **dict.fromkeys(("dolfinx", "ufl", "basix", "ffcx", "petsc4py", "mpi4py", "gmsh"), _FENICS),
    **dict.fromkeys(("igl", "nibabel", "nrrd", "pydicom", "mmgpy"), _PIP.format(".[organs]")),
    "pyvista": _PIP.format(".[view]"),
}


def sentence_on(missing: ModuleNotFoundError) -> str:
    """Return a sentence on a missing library, "" for a module of the program itself."""
    library, _, _ = (missing.name or "epsmesh").partition(".")
    if library == "epsmesh":
        return ""
    return f"the Python library {library} is missing: {_REMEDIES.get(library, _PIP.format('.'))}"
