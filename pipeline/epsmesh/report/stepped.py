"""Values over time of cases that are computed in time steps: their records have them at their own times."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from epsmesh.arrays import FloatArray
from epsmesh.run.record import Record


def stepped_values(
    found: Mapping[str, xr.DataArray], dims: list[str], records: Sequence[Record | None], times: FloatArray
) -> dict[str, xr.DataArray]:
    """Return the variables of ``found`` with the values of the ``records``, at ``times`` (s), in place of theirs.

    There is one record for each case, None for a case that keeps its values.
    """
    changed: dict[str, FloatArray] = {}
    for number, record in enumerate(records):
        if record is None or not record.is_ok or not record.course:
            continue
        for name, own in _values(record, times).items():
            if name not in changed:
                values = found[name].transpose(*dims, ..., "time").values
                changed[name] = values.reshape(len(records), *values.shape[len(dims) :]).copy()
            changed[name][number] = own
    of = {name: found[name].transpose(*dims, ..., "time") for name in changed}
    return {name: of[name].copy(data=values.reshape(of[name].shape)) for name, values in changed.items()}


def _values(record: Record, times: FloatArray) -> dict[str, FloatArray]:
    """Return what a record has over time, at ``times``.

    The error bar has three parts: that of the mesh, the same share of F as that of the elastic force; that of the time
    steps; and that of the interpolation between these. A smaller contact has fewer elements: the first part is then
    larger by the ratio of the areas, as the error of a contact is. Before the tool touches the first node, it is the
    whole force at that time.
    """
    force, between = _at(record, "force", times)
    steps, _ = _at(record, "step_error", times)
    rest = steps + between
    vector = np.array([_at(record, name, times)[0] for name in "xyz"])
    size, elastic = np.abs(force), abs(record.force)
    of_contact = _of_contact(record, times) if "area" in record.course else {}
    if of_contact:
        area = of_contact["contact_area"]
        wider = np.maximum(1.0, record.contact_area / np.where(area > 0, area, np.inf))
        first = int(np.argmax(area > 0))
        is_before = (times > 0) & (np.arange(len(times)) < first)
        rest = rest + record.force_error * size * (wider - 1) + np.where(is_before, size[first], 0.0)
    of_mesh = np.outer(np.abs(record.force_vector_error), size / elastic)
    shares = np.abs(vector) / np.where(size > 0, size, np.inf)
    heat, of_heat = _at(record, "dissipated", times)
    return of_contact | {
        "force": force + 0.0,
        "force_error": record.force_error * size + rest,
        "force_vector": vector,
        "force_vector_error": of_mesh + shares * rest,
        "dissipated_energy": heat,
        "dissipated_energy_error": record.force_error * heat + _at(record, "dissipated_error", times)[0] + of_heat,
    }


def _of_contact(record: Record, times: FloatArray) -> dict[str, FloatArray]:
    """Return area and radius of contact at ``times``; and their bars, which go with the elements across it."""
    area, between = _at(record, "area", times)
    area = np.maximum(area, 0.0)
    known = np.where(area > 0, area, np.inf)
    bar = record.contact_area_error * np.sqrt(np.maximum(1.0, record.contact_area / known)) + between / known
    found = {"contact_area": area, "contact_radius": np.sqrt(area / np.pi)}
    return found | {"contact_area_error": bar * area, "contact_radius_error": bar / 2 * found["contact_radius"]}


def _at(record: Record, name: str, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return values at ``times``, NaN after the end, and by how much two interpolations differ."""
    own, values = np.array(record.course["time"]), np.array(record.course[name])
    linear = np.interp(times, own, values, right=np.nan)
    is_known = np.isin(times, own) | np.isnan(linear)
    if is_known.all() or len(own) < 3:
        return linear, np.zeros_like(linear)
    from scipy.interpolate import PchipInterpolator  # noqa: PLC0415 (it takes a while to load)

    found = linear.copy()
    found[~is_known] = PchipInterpolator(own, values)(times[~is_known])
    return found, np.abs(found - linear)
