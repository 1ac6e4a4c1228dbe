"""Values at points as datasets: names, units and coordinates; and the grid of a plane."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.solve.points.derived import principal, von_mises
from epsmesh.solve.points.state import Values

if TYPE_CHECKING:
    import xarray as xr

# A plane's first axis is the projection of x, unless its normal is closer to x than this cosine: then that of y.
_CLOSE = 0.9
_AXES = ("x", "y", "z")


def dataset_of(
    values: Values,
    influence: FloatArray | None,
    bars: dict[str, FloatArray],
    points: FloatArray,
    coordinates: dict[str, tuple[tuple[str, ...], Any, dict[str, Any]]],
    shape: tuple[int, ...],
    region_names: Sequence[str],
) -> "xr.Dataset":
    """Return a dataset of ``values`` at ``points`` (n, 3), n the product of a ``shape`` of dimensions.

    ``influence`` (n) is in 1/m³, None if it is unknown. ``bars`` are 95 % error bars by variable, in its unit.
    ``coordinates`` are those of the dimensions, in their order: dimensions, values and attributes.
    """
    import xarray as xr  # noqa: PLC0415 (slow to import)

    dims = tuple(coordinates)
    strain = "strain" if values.is_linear else "Green-Lagrange strain"
    stress = "stress" if values.is_linear else "Cauchy stress"
    variables: dict[str, tuple[FloatArray, tuple[str, ...], str, str]] = {
        "displacement": (values.displacement, ("component",), "m", "displacement"),
        "strain": (values.strain, ("row", "column"), "1", strain),
        "stress": (values.stress, ("row", "column"), "Pa", stress),
        "principal_stress": (principal(values.stress), ("principal",), "Pa", f"principal {stress}, largest first"),
        "von_mises": (von_mises(values.stress), (), "Pa", f"von Mises stress of the {stress}"),
        "contact_pressure": (values.contact, (), "Pa", "pressure normal to the tool's footprint, NaN elsewhere"),
    }
    if influence is not None:
        meaning = "influence on the force, ∂ln F/∂ln E per volume, mean of the cell"
        variables["influence"] = (influence, (), "m-3", meaning)
    for name, found in bars.items():
        variables[f"{name}_error"] = (found, (), variables[name][2], f"error bar (95 %) on {name}, by the mesh")
    data: dict[str, Any] = {
        name: ((*dims, *own), found.reshape(*shape, *found.shape[1:]), {"units": unit, "long_name": meaning})
        for name, (found, own, unit, meaning) in variables.items()
    }
    about = {"long_name": "region: -1 outside the body", "names": list(region_names)}
    data["region"] = (dims, values.region.reshape(shape), about)
    places = {
        axis: (dims, points[:, number].reshape(shape), {"units": "m", "long_name": f"{axis} of the undeformed body"})
        for number, axis in enumerate(_AXES)
    }
    labels: dict[str, Any] = {name: list(_AXES) for name in ("component", "row", "column")}
    labels["principal"] = [1, 2, 3]
    return xr.Dataset(data, coords={**coordinates, **places, **labels})


def plane_axes(normal: FloatArray) -> FloatArray:
    """Return two unit vectors in rows (2, 3), normal to ``normal`` and to each other.

    The first is the projection of x, or of y for a plane across x. The largest component of the second is positive.
    """
    normal = normal / np.linalg.norm(normal)
    first = np.eye(3)[1 if abs(normal[0]) > _CLOSE else 0]
    first = first - normal * (normal @ first)
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    return np.array([first, second * np.sign(second[np.abs(second).argmax()])]) + 0.0


def in_plane(corners: FloatArray, origin: FloatArray, axes: FloatArray, spacing: float) -> list[FloatArray]:
    """Return the multiples of ``spacing`` (m) that cover ``corners`` (n, 3) along each of the ``axes``."""
    reach = (corners - origin) @ axes.T / spacing
    low, high = np.ceil(reach.min(axis=0) - 1e-9), np.floor(reach.max(axis=0) + 1e-9)
    return [spacing * np.arange(int(a), int(b) + 1) for a, b in zip(low, high, strict=True)]
