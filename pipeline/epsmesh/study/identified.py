"""The material that an identification found: read into a study from its dataset, with error bars and correlation.

``[material] from = "results/punch.nc"`` takes the place of the values that were identified. What was read is written
to the end of the study's text, as the table ``[identified]``: the text is then the whole study, whatever becomes of the
file, and another result is another study.
"""

import copy
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, FiniteFloat, ValidationError, model_validator

from epsmesh.arrays import FloatArray
from epsmesh.shapes.section import Words
from epsmesh.shapes.tissue import NUMBERS_OF_LAWS, name_in_term
from epsmesh.study.problems import Problems, StudyError, tuples
from epsmesh.study.text import toml_of
from epsmesh.study.toml import to_toml

if TYPE_CHECKING:
    import xarray as xr

WORDS = Words(
    "Dataset of an identification, which gives young, poisson and all else that it found. `force_uncertainty` in the "
    "dataset is then the error bar of F by theirs.",
    '"results/punch.nc"',
    default="none",
    takes="text",
)
# A text that may be of a study with this key.
FROM = re.compile(r"\bfrom\b")
_COMMAND = "`epsmesh identify STUDY` writes it"
# Variables that a study needs, and those that are read; unknowns that an identification has at most.
_NEEDED = ("estimate", "low", "high", "correlation", "seen", "unknown")
_READ = (*_NEEDED, "low_hidden", "high_hidden", "wanted", "unknown_2")
_MOST_UNKNOWNS = 1000
FITS = "fits"  # the verdict of a model that suits the curves
# Keys that are filled in, of [material] or of a layer or an inclusion by its name, and units of values.
_KEYS = ("young", "poisson", "thickness", "radius", *NUMBERS_OF_LAWS)
_UNITS = {"young": " Pa", "thickness": " m", "radius": " m", "time": " s"}


class Identified(BaseModel):
    """Parameters of the tissue as an identification found them, in SI units, with 95 % bars from ``low`` to ``high``.

    ``known`` are the keys of [material] that the identification had as known, as its study has them.
    """

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", defer_build=True)

    file: str = ""
    unknown: tuple[str, ...] = ()
    estimate: tuple[FiniteFloat, ...] = ()
    low: tuple[FiniteFloat, ...] = ()
    high: tuple[FiniteFloat, ...] = ()
    correlation: tuple[tuple[FiniteFloat, ...], ...] = ()
    known: dict[str, Any] = {}

    @model_validator(mode="after")
    def _has_all(self) -> "Identified":
        lists = (self.estimate, self.low, self.high, self.correlation, *self.correlation)
        if any(len(one) != len(self.unknown) for one in lists):
            raise ValueError("needs a value, a bar and a row of the correlation for each unknown")
        return self

    @property
    def values(self) -> dict[str, float]:
        """The estimates by name."""
        return dict(zip(self.unknown, self.estimate, strict=True))


NOTHING = Identified()
_ANY = {"young": "1 kPa", "poisson": 0.3}


def with_identified(
    raw: Mapping[str, Any], text: str, file: str, problems: Problems
) -> tuple[dict[str, Any], str, Identified]:
    """Return a study with the values that ``material.from`` names filled in, its text, and what was read."""
    own = raw.get("identified")
    rest = {key: value for key, value in raw.items() if key != "identified"}
    material = raw.get("material")
    tables = [one for one in (material if isinstance(material, list) else [material]) if isinstance(one, dict)]
    if not any("from" in one for one in tables):
        if own is not None:
            problems.error("identified", None, 'is written by the program, for [material] from = "results/NAME.nc"')
        return rest, text, NOTHING
    if not isinstance(material, dict):
        problems.error("material.from", None, "must be in one table: write [material]")
        return rest, text, NOTHING
    try:
        table = _read(material["from"], Path(file).parent) if own is None else own
        found = _sound(table, problems)
    except _UnusableError as error:
        problems.error("material.from", material["from"], str(error))
        found = NOTHING
    if found is NOTHING:  # which was reported: the rest is checked all the same
        return rest | {"material": _ANY | {k: v for k, v in material.items() if k != "from"}}, text, NOTHING
    if own is None and text:
        text = f"{text.rstrip()}\n{to_toml({'identified': table}, file)}"
    return _filled(rest, material, found, problems), text, found


def _sound(table: Any, problems: Problems) -> Identified:
    """Return the table of a study's text, nothing, with a report, if it is not what the program writes."""
    try:
        return Identified.model_validate({key: tuples(v) for key, v in table.items()} if isinstance(table, dict) else 0)
    except ValidationError as error:
        problems.error("identified", None, f"is not as the program writes it: {error.errors()[0]['msg']}")
        return NOTHING


def _filled(raw: dict[str, Any], material: dict[str, Any], found: Identified, problems: Problems) -> dict[str, Any]:
    """Return the study with the values found; what it gives beside them is reported, but for those of layers."""
    own = {key: value for key, value in material.items() if key != "from"}
    new = _material(found.values) | _tables(found.values, found.known)
    for key in own.keys() & new.keys():
        problems.error(f"material.{key}", own[key], "excludes `from`, which has it: leave one of them out")
    for key in own.keys() & found.known.keys():
        if own[key] != found.known[key]:
            allowed = f"must be {json.dumps(found.known[key])}, with which {found.file} was found, or left out"
            problems.error(f"material.{key}", own[key], allowed)
    tissue: dict[str, Any] = found.known | own | new
    of_pieces: dict[str, Any] = {}
    if tissue.keys() <= {"relaxation"}:  # layers fill the body: they have all that was found, and relax alike
        tissue, of_pieces = {}, tissue
    filled = {key: value for key, value in raw.items() if key != "material"} | ({"material": tissue} if tissue else {})
    if body := raw.get("body"):
        bodies = [_body(one, found.values, of_pieces) for one in (body if isinstance(body, list) else [body])]
        filled["body"] = bodies if isinstance(body, list) else bodies[0]
    return filled


def _material(values: Mapping[str, float]) -> dict[str, Any]:
    """Return the keys of [material] among the values found."""
    terms: dict[str, dict[str, Any]] = {}
    found: dict[str, Any] = {}
    for name, value in values.items():
        kind, _, rest = name.partition("_")
        key, _, number = rest.partition("_")
        if kind == "relaxation":
            terms.setdefault(number, {})[key] = _written(key, value)
        elif name in _KEYS:
            found[name] = _written(name, value)
    return found | ({"relaxation": [terms[number] for number in sorted(terms)]} if terms else {})


def _tables(values: Mapping[str, float], known: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of [material], fibres and terms, with the values found in place of those ``known``."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        if place := _place(name, known):
            key, number = place[:2]
            table = found.setdefault(key, copy.deepcopy(known[key]))
            (table if number is None else table[number])[place[2]] = value
    return found


def _place(name: str, material: Mapping[str, Any]) -> tuple[str, int | None, str] | None:
    """Return key, number of the table from 0, and key in it, of a number of a table of [material], by its name."""
    fibres, terms = material.get("fibres"), material.get("terms")
    if isinstance(fibres, Mapping) and name in fibres:
        return "fibres", None, name
    for number, term in enumerate(terms if isinstance(terms, Sequence) else ()):
        for key in term:
            if key != "name" and name == name_in_term(str(term.get("name", "")), number, key):
                return "terms", number, key
    return None


def _body(body: Any, values: Mapping[str, float], all_have: Mapping[str, Any]) -> Any:
    """Return a body whose layers and inclusions have the values found under their names, and what ``all_have``.

    What they say themselves stays.
    """
    if not isinstance(body, dict):
        return body
    filled = dict(body)
    for kind in ("layer", "inclusion", "region"):
        pieces = body.get(kind)
        if isinstance(pieces, list):
            filled[kind] = [
                dict(all_have) | _piece(piece, values) if isinstance(piece, dict) else piece for piece in pieces
            ]
    return filled


def _piece(piece: dict[str, Any], values: Mapping[str, float]) -> dict[str, Any]:
    start = f"{piece.get('name', '')}_"
    own = {name.removeprefix(start): value for name, value in values.items() if name.startswith(start)}
    return {key: _written(key, value) for key, value in own.items()} | piece


def _is_relaxation(name: str) -> bool:
    return name.startswith("relaxation_")


def _written(key: str, value: float) -> Any:
    unit = _UNITS.get(key)
    return f"{value!r}{unit}" if unit else value


class _UnusableError(ValueError):
    """A dataset that gives no material, and why."""


def _read(path: Any, folder: Path) -> dict[str, Any]:
    """Return the table of what the dataset at ``path`` says.

    Raises:
        _UnusableError: if it cannot be used.
    """
    if not isinstance(path, str) or not path:
        raise _UnusableError('must be the dataset of an identification, such as "results/punch.nc"')
    # Results are in a folder beside that of the studies: both are looked for.
    place = next((place for place in (folder / path, Path(path)) if place.is_file()), None)
    if place is None:
        raise _UnusableError(f"there is no such file; {_COMMAND}")
    import xarray as xr  # noqa: PLC0415 (slow to load, and few studies need it)

    try:
        with xr.open_dataset(place, engine="netcdf4") as opened:
            known = [name for name in _READ if name in opened.variables]
            # A few bytes of a packed file may stand for any number of values.
            if not {*_NEEDED} <= {*known} or opened.sizes["unknown"] > _MOST_UNKNOWNS:
                raise _UnusableError(f"is not the dataset of an identification; {_COMMAND}")
            if "file" in opened.sizes:
                raise _UnusableError(
                    f"has {opened.sizes['file']} files, each with its own values: identify one of them"
                )
            dataset = opened[known].load()
    except _UnusableError:
        raise
    except (OSError, ValueError, RuntimeError, KeyError) as error:
        raise _UnusableError(f"is no netCDF file that can be read: {error}") from None
    if (verdict := str(dataset.attrs.get("verdict", ""))) != FITS:
        raise _UnusableError(f"the law does not describe the curve, so that no value has a bar: {verdict}")
    try:
        return _table(path, dataset)
    except (KeyError, StudyError) as error:
        raise _UnusableError(f"cannot be used: {error}") from None


def _table(path: str, dataset: "xr.Dataset") -> dict[str, Any]:
    """Return what a study needs of a dataset: the tissue's parameters, with the wider of their two bars.

    Raises:
        _UnusableError: if a parameter is not in the curves.
    """
    tissue = [name for name in map(str, dataset["unknown"].values) if not is_of_test(name)]
    if scales := [name for name in tissue if name.rpartition("_")[2] == "scale"]:
        raise _UnusableError(f"{', '.join(scales)} cannot be passed on: write it into the table of the field")
    if not any(name == "young" or name.endswith("_young") for name in tissue):
        raise _UnusableError("has no `young`: identify it")
    own = dataset.sel(unknown=tissue, unknown_2=tissue)
    # What was known beforehand and only widens the bars of others need not be in the curves.
    sought = own["seen"].where(own["wanted"] == 1, 1) if "wanted" in own else own["seen"]
    if unseen := [name for name in tissue if not bool(sought.sel(unknown=name))]:
        what = f"{', '.join(unseen)} cannot be identified from its curves: "
        raise _UnusableError(f"{what}give a value in the study of the identification, or add a curve that tells it")
    ends = {end: own.get(f"{end}_hidden", own[end]) for end in ("low", "high")}
    ends = {end: values.where(values.notnull(), own[end]) for end, values in ends.items()}
    material = toml_of(str(dataset.attrs.get("study", "")), path).get("material", {})
    passed_on = {name for name in tissue if name.rpartition("_")[2] in _KEYS or _place(name, material)}
    if unknown := [name for name in tissue if name not in passed_on and not _is_relaxation(name)]:
        raise _UnusableError(
            f"{', '.join(unknown)} cannot be passed on: write the values into the table of the layer or region"
        )
    own_keys = (*tissue, "young", "from", *(("relaxation",) if any(map(_is_relaxation, tissue)) else ()))
    known = {key: value for key, value in material.items() if key not in own_keys}
    return {
        "file": path,
        "unknown": tissue,
        "estimate": own["estimate"].values.tolist(),
        **{end: values.values.tolist() for end, values in ends.items()},
        "correlation": _correlation(own, ends).tolist(),
    } | ({"known": known} if known else {})


def _correlation(own: "xr.Dataset", wider: "Mapping[str, xr.DataArray]") -> FloatArray:
    """Return the correlation (u, u) of errors that are within the wider bars.

    That of the dataset is of the narrower ones. What may be undeclared moves each parameter on its own.
    """
    share = ((own["high"] - own["low"]) / (wider["high"] - wider["low"])).clip(0, 1).fillna(1).values
    found = own["correlation"].values * np.outer(share, share)
    np.fill_diagonal(found, 1.0)
    return np.asarray(found)


def is_of_test(name: str) -> bool:
    """Return whether an unknown belongs to the experiment or its specimen, not to the tissue."""
    is_own = " of " in name  # of one measurement
    return is_own or name in ("friction", "radius", "thickness") or name.startswith(_OF_TEST)


# Several curves have one each, with the name of the curve behind.
_OF_TEST = ("contact_point", "machine_stiffness", "baseline", "tilt", "drift", "hidden_")
