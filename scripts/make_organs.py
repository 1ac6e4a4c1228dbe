"""Make the surfaces, the label maps and the stiffness map in meshes/: shapes like organs', copied from nobody's.

Ellipsoids that run into each other, with smooth noise, sampled as the voxels of a segmented image; the surface round
them, as a body `image` has it, with fewer facets. The same files every time: python scripts/make_organs.py
"""

import gzip
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import igl
import nibabel
import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.files import atomic
from epsmesh.shapes.files.label_surface import surface_of
from epsmesh.shapes.files.labels import LabelMap
from epsmesh.shapes.files.stl import written
from epsmesh.shapes.triangles import Triangles

MESHES = Path(__file__).resolve().parents[1] / "meshes"
Field = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Organ:
    """A body where ``field`` of places (…, 3), in mm, is negative, within ``half`` of the origin in x, y and z (mm)."""

    field: Field
    half: tuple[float, float, float]
    voxel: float  # mm
    facets: int


def ellipsoid(centre: tuple[float, float, float], axes: tuple[float, float, float]) -> Field:
    """About the distance (mm) from an ellipsoid, negative within."""

    def field(places: FloatArray) -> FloatArray:
        scaled = (places - centre) / axes
        level = np.linalg.norm(scaled, axis=-1)
        return np.asarray((level - 1) * level / np.maximum(np.linalg.norm(scaled / axes, axis=-1), 1e-9))

    return field


def blend(first: FloatArray, second: FloatArray, width: float) -> FloatArray:
    """The smaller of two distances, rounded over a width (mm) where they are alike."""
    share = np.clip(0.5 + (second - first) / (2 * width), 0, 1)
    return second + share * (first - second) - width * share * (1 - share)


def noise(places: FloatArray, length: float, seed: int, waves: int = 24) -> FloatArray:
    """Smooth noise of variance 1, with waves about as long as ``length`` (mm), in all directions."""
    random = np.random.Generator(np.random.PCG64(seed))
    directions = random.standard_normal((waves, 3))
    directions *= 2 * np.pi / length / np.linalg.norm(directions, axis=1, keepdims=True)
    phases = random.uniform(0, 2 * np.pi, waves)
    total = np.zeros(places.shape[:-1])
    for direction, phase in zip(directions, phases, strict=True):
        total += np.cos(places @ direction + phase)
    return total * np.sqrt(2 / waves)


def liver(places: FloatArray) -> FloatArray:
    """Like a liver: a thick lobe that runs out into a thin one, hollow below."""
    right = ellipsoid((-25, 0, -4), (52, 48, 34))(places)
    left = ellipsoid((42, -8, 4), (48, 32, 17))(places)
    hollow = ellipsoid((0, 10, -52), (45, 40, 32))(places)
    return -blend(-blend(right, left, 14), hollow, 8) + 0.8 * noise(places, 45, 1)


def kidney(places: FloatArray) -> FloatArray:
    """Like a kidney: a bean."""
    bean = ellipsoid((0, 0, 0), (54, 27, 22))(places)
    notch = ellipsoid((0, -30, 0), (15, 16, 14))(places)
    return -blend(-bean, notch, 7) + 0.4 * noise(places, 30, 2)


def brain(places: FloatArray) -> FloatArray:
    """Like a brain: two halves, folded all over."""
    halves = [ellipsoid((side * 26, 0, 0), (34, 62, 42))(places) for side in (-1, 1)]
    folds = np.abs(noise(places, 34, 3)) - 0.6
    return blend(*halves, 4) - 3.5 * np.tanh(2 * folds)


def tumour(places: FloatArray) -> FloatArray:
    """A ball in the liver."""
    return ellipsoid((-28.3, 4.4, 6.7), (9, 9, 9))(places)


Branch = tuple[tuple[float, float, float, float], tuple[float, float, float, float]]


def vessel(places: FloatArray, *branches: Branch) -> FloatArray:
    """A tree of straight branches, each from one ball to another: x, y, z and radius (mm) of both."""
    found: FloatArray | None = None
    for start, end in (np.array(branch) for branch in branches):
        along = end[:3] - start[:3]
        share = np.clip((places - start[:3]) @ along / (along @ along), 0, 1)
        away = np.linalg.norm(places - start[:3] - share[..., None] * along, axis=-1)
        distance = away - (start[3] + share * (end[3] - start[3]))
        found = distance if found is None else blend(found, distance, 3)
    assert found is not None
    return found


def lump(places: FloatArray) -> FloatArray:
    """A tumour of no simple shape."""
    return blend(ellipsoid((-32, 4, 12), (10, 8, 7))(places), ellipsoid((-24, 7, 13), (7, 8, 6))(places), 4)


def portal_vein(places: FloatArray) -> FloatArray:
    """Like a portal vein: a trunk with a branch to each side."""
    fork = (-6.0, 2.0, -9.0, 5.0)
    right, left = (-30.0, 0.0, -9.0, 5.0), (42.0, -8.0, 4.0, 4.0)
    return vessel(
        places, (fork, right), (right, (-56.0, 10.0, -6.0, 4.0)), (right, (-52.0, -18.0, -8.0, 4.0)), (fork, left)
    )


def hepatic_vein(places: FloatArray) -> FloatArray:
    """Like a hepatic vein: an arch above the portal vein."""
    knee = (-14.0, -14.0, 8.0, 5.0)
    return vessel(places, ((10.0, 14.0, 9.0, 5.0), knee), (knee, (-48.0, -22.0, 8.0, 4.0)))


def upper(places: FloatArray) -> FloatArray:
    """Like the thin edge of a liver, upright."""
    return ellipsoid((-5, 0, 4), (8, 21, 24))(places) + 0.3 * noise(places, 18, 6)


def beside(places: FloatArray) -> FloatArray:
    """Like a part of a stomach that lies against it, and ends below its upper edge."""
    return ellipsoid((7, 1, -7), (9, 19, 15))(places) + 0.3 * noise(places, 18, 7)


def of_stomach(places: FloatArray) -> FloatArray:
    """The part of both that is nearer to the stomach's middle than to the liver's surface."""
    return np.maximum(beside(places), beside(places) - upper(places))


# Regions of the patient's liver, with labels from 2.
PATIENT: dict[str, Field] = {"tumour": lump, "portal vein": portal_vein, "hepatic vein": hepatic_vein}

# Two organs that touch.
TOUCHING = Organ(lambda places: np.minimum(upper(places), beside(places)), (17, 24, 31), 1.5, 0)
ORGANS = {
    "liver.stl": Organ(liver, (100, 60, 50), 2.0, 5000),
    "kidney.obj": Organ(kidney, (62, 38, 32), 1.25, 3000),
    "brain.ply": Organ(brain, (72, 74, 54), 1.5, 12000),
}


def label_map(organ: Organ, *inside: Field) -> LabelMap:
    """The organ as an image: label 1, and 2, 3, … where other bodies lie ``inside``."""
    counts = [int(2 * half / organ.voxel) + 1 for half in organ.half]
    affine = np.column_stack([np.eye(3) * organ.voxel, -np.array(organ.half)])
    places = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1) @ affine[:, :3].T + affine[:, 3]
    values = (organ.field(places) < 0).astype(np.uint8)
    for label, field in enumerate(inside, start=2):
        values[field(places) < 0] = label
    return LabelMap(values, affine * 1e-3)


def surface(organ: Organ) -> tuple[FloatArray, IntArray]:
    """The surface round an organ's voxels, in mm, with fewer facets."""
    whole: Triangles = surface_of(label_map(organ), 1).triangles
    points, facets, _, _ = igl.qslim(
        np.asfortranarray(1e3 * whole.points), np.asfortranarray(whole.facets, dtype=np.int32), organ.facets, True
    )
    return np.round(points, 3), np.asarray(facets, dtype=np.int64)


def stl(points: FloatArray, facets: IntArray) -> bytes:
    """A binary STL file."""
    return written(points, facets, b"Like an organ; made by scripts/make_organs.py, mm".ljust(80))


def obj(points: FloatArray, facets: IntArray) -> bytes:
    """An OBJ file."""
    lines = ["# Like an organ; made by scripts/make_organs.py, mm"]
    lines += [f"v {x:.3f} {y:.3f} {z:.3f}" for x, y, z in points] + [f"f {a} {b} {c}" for a, b, c in facets + 1]
    return "\n".join([*lines, ""]).encode()


def ply(points: FloatArray, facets: IntArray) -> bytes:
    """A binary PLY file."""
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment Like an organ; made by scripts/make_organs.py, mm\n"
        f"element vertex {len(points)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(facets)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.zeros(len(facets), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, facets
    return header.encode() + points.astype("<f4").tobytes() + rows.tobytes()


WRITERS = {".stl": stl, ".obj": obj, ".ply": ply}


def image(*inside: Field, organ: Organ = ORGANS["liver.stl"]) -> bytes:
    """The liver, or another ``organ``, with other bodies in it, as a NIfTI label map."""
    labels = label_map(organ, *inside)
    found = nibabel.Nifti1Image(labels.values, np.vstack([labels.affine * 1e3, [0, 0, 0, 1]]))
    found.header.set_xyzt_units("mm")
    return gzip.compress(found.to_bytes(), mtime=0)


def names(file: str, *labels: str) -> bytes:
    """The names of an image's labels, from 1, as ITK-SNAP writes them."""
    lines = [f'{label} 0 0 0 1 1 1 "{name}"' for label, name in enumerate(labels, start=1)]
    return "\n".join([f"# Labels of {file}; made by scripts/make_organs.py", *lines, ""]).encode()


def stiffness() -> bytes:
    """A map of the liver's stiffness (kPa), as elastography has it: voxels of 3 mm, and no value near the surface."""
    counts, voxel, half = (67, 41, 34), 3.0, (100.0, 60.0, 50.0)
    affine = np.vstack([np.column_stack([np.eye(3) * voxel, -np.array(half)]), [0, 0, 0, 1]])
    places = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1) @ affine[:3, :3].T + affine[:3, 3]
    values = 5 * np.exp(0.25 * noise(places, 40, 5))
    values += 20 / (1 + np.exp(lump(places) / 1.5))
    values[liver(places) > -2] = np.nan
    found = nibabel.Nifti1Image(np.round(values, 2).astype(np.float32), affine)
    found.header.set_xyzt_units("mm")
    return gzip.compress(found.to_bytes(), mtime=0)


FILES: dict[str, Callable[[], bytes]] = {
    **{name: lambda name=name: WRITERS[Path(name).suffix](*surface(ORGANS[name])) for name in ORGANS},
    "liver.nii.gz": lambda: image(tumour),
    "patient.nii.gz": lambda: image(*PATIENT.values()),
    "patient.txt": lambda: names("patient.nii.gz", "liver", *PATIENT),
    "organs.nii.gz": lambda: image(of_stomach, organ=TOUCHING),
    "organs.txt": lambda: names("organs.nii.gz", "liver", "stomach"),
    "stiffness.nii.gz": stiffness,
}


def make(name: str) -> bytes:
    """The content of one of the files."""
    return FILES[name]()


def main(folder: Path = MESHES) -> None:
    """Write the files."""
    for name in FILES:
        content = make(name)
        with atomic(folder / name) as temporary:
            temporary.write_bytes(content)
        print(f"{folder / name}: {len(content) / 1e3:.0f} kB")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
