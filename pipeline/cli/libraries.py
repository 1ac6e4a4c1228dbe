"""Libraries that pip alone does not install, and how to get them."""

_FENICS = "on Debian `make setup` installs it, elsewhere `conda env create -f environment.yml`"
_ORGANS = "`pip install 'epsmesh[organs]'` installs it (on Debian: `make setup`)"
_REMEDIES = {
    **dict.fromkeys(("dolfinx", "ufl", "basix", "ffcx", "petsc4py", "mpi4py", "gmsh"), _FENICS),
    **dict.fromkeys(("igl", "nibabel", "nrrd"), _ORGANS),
}


def how_to_get(module: str | None) -> str | None:
    """Return a sentence that says how to install ``module``; None if it is not one of these libraries."""
    library = (module or "").partition(".")[0]
    remedy = _REMEDIES.get(library)
    return remedy and f"the library {library} is missing: {remedy}"
