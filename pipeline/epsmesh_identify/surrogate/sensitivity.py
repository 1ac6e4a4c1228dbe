"""Sensitivity of a study's outputs to its parameters: surrogates, Sobol's indices of them, and their dataset."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import ndtri

from epsmesh.arrays import FloatArray
from epsmesh.quantities import QUANTITIES
from epsmesh.report.influence import OF_NORMAL
from epsmesh.report.uncertainty import Bar, bars, written
from epsmesh.study.problems import Problem, StudyError
from epsmesh.study.sweep import Study
from epsmesh_identify.sections.identification import Sought
from epsmesh_identify.sections.kept import spread_of
from epsmesh_identify.sections.parameters import DEPTH
from epsmesh_identify.surrogate.build import surrogate
from epsmesh_identify.surrogate.cases import Domain, Solve, SurrogateError, domain_of
from epsmesh_identify.surrogate.derived import FORCE, Output
from epsmesh_identify.surrogate.sobol import Indices, sobol
from epsmesh_identify.surrogate.table import Table

_WORDS = {
    "output": "variable of the study's dataset",
    "parameter": "parameter of the study",
    "first": "share of the output's variance that vanishes, on average, if the parameter is known (Sobol's index of "
    "first order)",
    "first_error": "error bar (95 %) on first: of the sample, and of the surrogate",
    "total": "share of the output's variance that is left, on average, if all other parameters are known (Sobol's "
    "total index)",
    "total_error": "error bar (95 %) on total: of the sample, and of the surrogate",
    "mean": "mean of the output over all parameters, in its unit",
    "deviation": "standard deviation of the output, relative to its mean",
    "surrogate_error": "error bar (95 %) on the surrogate, relative to the output: interpolation, and meshes if the "
    "output has error bars",
    "cases": "number of the surrogate's cases",
    "low": "least value of the parameter, in its unit",
    "high": "largest value of the parameter, in its unit",
    "expected": "mean of a parameter with a normal distribution, in its unit; missing where all values are alike",
    "expected_error": "95 % of the values of such a parameter are within this distance of its mean",
    "unit": "unit of the parameter",
    "output_unit": "unit of the output",
}
# Relative differences of an output that are round-off.
_ALIKE = 1e-9
_SHARES = ("first", "first_error", "total", "total_error", "deviation", "surrogate_error", "cases")


@dataclass(frozen=True)
class Explained:
    """Indices of one output, and the surrogate that they are of."""

    output: Output
    indices: Indices
    table: Table

    @property
    def error(self) -> float:
        """Relative error of the surrogate."""
        return self.table.interpolation + self.table.mesh


def explain(study: Study, solve: Solve) -> list[Explained]:
    """Return the indices of every output of a study's section [sensitivity].

    Raises:
        StudyError: if the study has no such section, or is not one scene.
        SurrogateError: if a case that a surrogate needs has no output.
    """
    if not spread_of(study).varied:
        why = 'is required: parameters with ranges, such as young = ["5 kPa", "20 kPa"]'
        raise StudyError(study.file, [Problem("[sensitivity]", None, why)])
    return [_explained(study, _output(study, name), solve) for name in spread_of(study).outputs]


def _output(study: Study, name: str) -> Output:
    """Return the output of a name: the study's own, or a result of every study."""
    units = {one.name: one.attributes["units"] for one in study.outputs}
    return Output(name, units.get(name) or QUANTITIES[name].unit)


def spread_domain(study: Study, output: Output = FORCE) -> Domain:
    """Return the domain of the surrogate of an output over the section [sensitivity] of a study.

    Raises:
        StudyError: if the study is not one scene.
    """
    bounds = {one.parameter.name: (one.low, one.high) for one in spread_of(study).varied if one.parameter != DEPTH}
    shallowest, deepest = _depths(study)
    return domain_of(study, bounds, deepest, shallowest, output)


def _explained(study: Study, output: Output, solve: Solve) -> Explained:
    domain, varied = spread_domain(study, output), spread_of(study).varied
    table = surrogate(domain, solve)

    def function(points: FloatArray) -> FloatArray:
        values = {one.parameter.name: _quantiles(one, x) for one, x in zip(varied, points.T, strict=True)}
        return table.sampled(values, values.pop(DEPTH.name, np.full(len(points), domain.deepest)))

    ends = function(np.array([[0.0] * len(varied), [0.5] * len(varied), [1.0] * len(varied)]))
    if np.ptp(ends) <= _ALIKE * abs(ends[0]):
        names = ", ".join(one.parameter.name for one in varied)
        raise SurrogateError(f"{study.file}: {output.name} depends on none of {names}")
    acting = [number for number, one in enumerate(varied) if one.parameter.name in {*table.acting, DEPTH.name}]
    return Explained(output, sobol(function, len(varied), table.interpolation + table.mesh, acting=acting), table)


def _depths(study: Study) -> tuple[float, float]:
    """Return the least and the largest depth (m)."""
    for one in spread_of(study).varied:
        if one.parameter == DEPTH:
            return one.low, one.high
    depths = sorted({probe.depth for probe in study.probes})
    if len(depths) > 1:
        allowed = f"is a list of {len(depths)}: one value is needed, or a range in [sensitivity]"
        raise StudyError(study.file, [Problem("probe.depth", None, allowed)])
    return depths[0], depths[0]


def _quantiles(one: Sought, share: FloatArray) -> FloatArray:
    """Return the values (n,) below which a share (n,) of all values is."""
    if one.prior is not None:
        mean, deviation = one.prior
        return np.clip(mean + deviation * ndtri(share), one.low, one.high)
    if one.parameter.is_logarithmic and one.low > 0:
        return np.asarray(one.low * (one.high / one.low) ** share)
    return np.asarray(one.low + (one.high - one.low) * share)


def dataset_of(study: Study, found: Sequence[Explained], own: xr.Dataset | None = None) -> xr.Dataset:
    """Return the indices of all outputs as a dataset; with the study's ``own``, what its other error bars are."""
    varied = spread_of(study).varied
    both, of_output = ("output", "parameter"), ("output",)
    values: dict[str, Any] = {
        name: (both, [getattr(one.indices, name) for one in found])
        for name in ("first", "first_error", "total", "total_error")
    }
    values |= {name: (of_output, [getattr(one.indices, name) for one in found]) for name in ("mean", "deviation")}
    values["surrogate_error"] = of_output, [one.error for one in found]
    values["cases"] = of_output, [one.table.cases for one in found]
    values |= {name: (("parameter",), [getattr(one, name) for one in varied]) for name in ("low", "high")}
    values["expected"] = ("parameter",), [one.prior[0] if one.prior else nan for one in varied]
    values["expected_error"] = ("parameter",), [2 * one.prior[1] if one.prior else nan for one in varied]
    values["unit"] = ("parameter",), np.array([one.parameter.unit for one in varied], dtype=object)
    values["output_unit"] = of_output, np.array([one.output.unit for one in found], dtype=object)
    names = {"output": [one.output.name for one in found], "parameter": [one.parameter.name for one in varied]}
    dataset = xr.Dataset(values, names)
    for name in dataset.variables:
        units = {"units": "1"} if name in _SHARES else {}
        dataset[name].attrs = {"long_name": _WORDS[str(name)]} | units
    of_force = [_bar(one, names["parameter"]) for one in found if one.output.name == FORCE.name]
    said = written([*bars(own), *of_force]) if own is not None and of_force else ""
    return dataset.assign_attrs(Conventions="CF-1.8", title=study.title, study=study.text, bars=said)


def _bar(found: Explained, names: Sequence[str]) -> Bar:
    """Return the error bar of F by the ranges of the parameters: that of a normal distribution as wide."""
    first = names[int(np.argmax(found.indices.first))]
    share = OF_NORMAL * found.indices.deviation
    return Bar("ranges of parameters", share, f"decide: measure {first} more exactly", ", ".join(names))
