"""Make the solid in meshes/ that a CAD program might have written: python scripts/make_cad.py

A phantom for presses: a capsule about as large as a kidney, half sunk into a plate with rounded corners. The face below
is named `base`, the one round the capsule `plate`. The same file every time, but for the kernel's version.
"""

import re
import sys
from pathlib import Path

import gmsh
import numpy as np

MESHES = Path(__file__).resolve().parents[1] / "meshes"
# mm: the plate's sizes and its corners' radius; the capsule's radius, the distance of its middle line's ends, and how
# far that line lies below the plate; the rounding at its foot.
PLATE, CORNER = (100.0, 70.0, 12.0), 12.0
RADIUS, LENGTH, BELOW, FOOT = 24.0, 30.0, 4.0, 4.0
_DATE = re.compile(r"'\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d'")


def draw() -> dict[int, str]:
    """Draw the phantom in gmsh's current model; return the names of faces by their places in the shell."""
    occ, (length, width, height) = gmsh.model.occ, PLATE
    plate = occ.addRectangle(-length / 2, -width / 2, -height, length, width, roundedRadius=CORNER)
    ((_, base),) = [entity for entity in occ.extrude([(2, plate)], 0, 0, height) if entity[0] == 3]
    parts = [(3, occ.addCylinder(-LENGTH / 2, 0, -BELOW, LENGTH, 0, 0, RADIUS))]
    parts += [(3, occ.addSphere(x, 0, -BELOW, RADIUS)) for x in (-LENGTH / 2, LENGTH / 2)]
    capsule, _ = occ.fuse(parts[:1], parts[1:])
    above = occ.addBox(-length / 2, -width / 2, -height / 2, length, width, 3 * RADIUS)
    capsule, _ = occ.intersect(capsule, [(3, above)])
    ((_, solid),), _ = occ.fuse([(3, base)], capsule)
    occ.synchronize()
    around = [tag for _, tag in gmsh.model.getEntities(1) if _is_foot(tag)]
    ((_, solid),) = occ.fillet([solid], around, [FOOT])
    occ.synchronize()
    names = {}
    for place, (_, face) in enumerate(gmsh.model.getBoundary([(3, solid)], oriented=False)):
        if gmsh.model.getType(2, face) == "Plane":
            z = occ.getCenterOfMass(2, face)[2]
            if np.isclose(z, -height):
                names[place] = "base"
            elif np.isclose(z, 0):
                names[place] = "plate"
    return names


def _is_foot(curve: int) -> bool:
    (start,), (end,) = gmsh.model.getParametrizationBounds(1, curve)
    points = np.array(gmsh.model.getValue(1, curve, np.linspace(start, end, 9).tolist())).reshape(-1, 3)
    off = np.hypot(np.maximum(np.abs(points[:, 0]) - LENGTH / 2, 0), points[:, 1])
    foot = np.sqrt(RADIUS**2 - BELOW**2)
    return bool(np.all(np.abs(points[:, 2]) < 1e-6) and np.all(np.abs(off - foot) < 1e-6))


def main() -> int:
    """Write the file, with names, and without the date and names of programs."""
    gmsh.initialize([""], readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    try:
        names = draw()
        MESHES.mkdir(exist_ok=True)
        path = MESHES / "phantom.step"
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    text = _DATE.sub("'2026-01-01T00:00:00'", path.read_text(encoding="latin-1"))
    numbers = [int(n) for n in re.findall(r"#(\d+)", re.search(r"CLOSED_SHELL\('',\(([^)]*)\)", text)[1])]
    for place, name in names.items():
        text = re.sub(rf"#{numbers[place]} = ADVANCED_FACE\(''", f"#{numbers[place]} = ADVANCED_FACE('{name}'", text)
    path.write_text(text, encoding="latin-1")
    print(path, path.stat().st_size)
    return 0


if __name__ == "__main__":
    sys.exit(main())
