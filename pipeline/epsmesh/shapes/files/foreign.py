"""Formats of images and surfaces that are not read, and what to convert their files to."""

from pathlib import Path

_IMAGE = "save it as .nrrd or .nii.gz in 3D Slicer or ITK-SNAP, which keep its position"
_SURFACE = "save its surface as .stl or .ply, in 3D Slicer, ParaView or MeshLab"
_FOREIGN = {
    ".mha": f"is a MetaImage, which is not read: {_IMAGE}",
    ".mhd": f"is the header of a MetaImage, which is not read: {_IMAGE}",
    ".mnc": f"is an image in MINC, which is not read: {_IMAGE}",
    ".vtk": f"is a file of VTK, which is not read: {_SURFACE}",
    ".vtp": f"is a surface of VTK, which is not read: {_SURFACE}",
    ".vtu": f"is a mesh of VTK, which is not read: {_SURFACE}",
    ".off": f"is a surface in OFF, which is not read: {_SURFACE}",
    ".3mf": f"is a surface in 3MF, which is not read: {_SURFACE}",
    ".gltf": f"is a scene in glTF, which is not read: {_SURFACE}",
    ".glb": f"is a scene in glTF, which is not read: {_SURFACE}",
}
_SURFACES = (".stl", ".ply", ".obj")
_SOLIDS = (".step", ".stp", ".brep", ".iges", ".igs")


def why_not_read(path: Path) -> str:
    """Return what a file in a known format is that is not read, and what to do; "" of any other file."""
    return _FOREIGN.get(path.suffix.lower(), "")


def why_no_study(path: Path) -> str:
    """Return why a file that was given in place of a study is none, by the ending of its name; "" if it may be one."""
    ending = path.suffix.lower()
    for endings, shape in ((_SURFACES, "surface"), (_SOLIDS, "cad")):
        if ending in endings:
            return (
                f'is no study: write one whose [body] has shape = "{shape}" and file = "{path.name}"; `epsmesh new '
                f"NAME --all` shows all keys"
            )
    return why_not_read(path)
