"""An identification in words: values with both error bars, what the curves do not tell, and the material to paste."""

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from math import floor, isfinite, log10

import numpy as np
import xarray as xr

from epsmesh.printable import counted
from epsmesh.quantities import quantity_of
from epsmesh.report.words import barred, percent
from epsmesh.states import FAILED
from epsmesh.study.identified import FITS, is_of_test
from epsmesh.study.text import toml_of
from epsmesh.study.toml import to_line

# What a study may leave undeclared, by the words of its key `may_hide`.
_UNDECLARED = {"layer": "layer", "base": "base", "strain": "stiffening"}
_SOURCES = {
    "noise": "noise",
    "contact": "contact point and baseline",
    "machine": "machine",
    "thickness": "thickness and radius",
    "law": "law",
    "mesh": "mesh and interpolation",
}
_NAMES = {
    "contact_point": "contact point",
    "machine_stiffness": "stiffness of the machine",
    "baseline": "baseline",
    "tilt": "tilt of the baseline",
    "drift": "drift",
}
_PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
# Unknowns whose error is given as a number, not as a share of their value: it may be 0, or is a share itself.
_ABSOLUTE = ("poisson", "friction", "baseline", "tilt", "drift", "contact_point", "share")
_SHARES = "relaxation_share_"
# Error bars whose sides differ by more than this share have no ±.
_UNEVEN = 0.25
# Names of files, and reasons why files failed, that are listed.
_MOST, _MOST_REASONS = 10, 5
_NUMBER = re.compile(r"-?\d+(\.\d+)?(e[+-]?\d+)?")


def wanted(dataset: xr.Dataset) -> list[str]:
    """Return the unknowns that were asked for, the moduli first."""
    names: list[str] = dataset["unknown"].values[dataset["wanted"].values.astype(bool)].astype(str).tolist()
    return sorted(names, key=lambda name: not name.endswith(("young", "scale")))


def answer(dataset: xr.Dataset) -> list[str]:
    """Return what was found, in sentences."""
    if "file" in dataset.dims:
        lines = list(_of_files(dataset))
    elif dataset.attrs["verdict"] != FITS:
        lines = list(_without_bars(dataset))
    else:
        lines = [of_unknown(dataset, name, is_short=number > 0) for number, name in enumerate(wanted(dataset))]
    return [*lines, *_hertz(dataset), *notes(dataset)]


def _hertz(dataset: xr.Dataset) -> Iterator[str]:
    """Yield what Hertz's formula gives for a ball."""
    if "hertz_young" in dataset:
        what = "median E" if "file" in dataset.dims else "E"
        value = engineering(float(dataset["hertz_young"].median()), "Pa", 4)
        yield f"Hertz's formula, a paraboloid on a half-space, by least squares: {what} = {value}."


def notes(dataset: xr.Dataset) -> list[str]:
    """Return what the fit has to say, in sentences; those of many files once."""
    if "file" in dataset.dims:
        files, lines = dataset["file"].values.astype(str), dataset["notes"].values.astype(str)
        said = [(file, line) for file, own in zip(files, lines, strict=True) for line in own.splitlines()]
        return [_ended(line) for line in once(said, len(files))]
    return [_ended(line) for line in str(dataset.attrs.get("notes", "")).splitlines() if line]


def _ended(sentence: str) -> str:
    return sentence if sentence.endswith((".", "?")) else f"{sentence}."


def once(said: Iterable[tuple[str, str]], count: int) -> Iterator[str]:
    """Yield sentences of files, pairs of names and sentences; those that differ in numbers only once, for all files.

    There are ``count`` files: of one, its name is not said.
    """
    if count == 1:
        yield from dict.fromkeys(line for _, line in said)
        return
    groups: dict[str, list[tuple[str, str]]] = {}
    for file, line in said:
        groups.setdefault(_NUMBER.sub("#", line), []).append((file, line))
    for (file, line), *others in groups.values():
        number = len({file, *(other for other, _ in others)})
        where = "all files" if number == count else f"{file} and {number - 1} more" if number > 1 else file
        yield f"{where}: {line}"


def of_unknown(dataset: xr.Dataset, name: str, *, is_short: bool = False) -> str:
    """Say what one unknown is, with both error bars; ``is_short`` leaves out what was said of another."""
    one = dataset.sel(unknown=name)
    what = title(name)
    if not bool(one["seen"]):
        ends = span(dataset, name, float(one["low"]), float(one["high"]))
        return f"{what} is not in {_curves(dataset)}: all values from {ends} fit."
    value = f"{what} = {estimated(dataset, name)}"
    first, second = bar(dataset, name), bar(dataset, name, hidden=True)
    first = first if first.startswith("±") else f"({first})"
    if not second or second == first or not if_undeclared(dataset):
        return f"{value} {first}."
    if is_short:
        return f"{value} {first} as declared; {second} with what may be undeclared."
    return f"{value} {first} if the body is as declared; {second} {if_undeclared(dataset)}."


def if_undeclared(dataset: xr.Dataset) -> str:
    """Return when the second error bar holds; "" if it is the first."""
    return words_of_undeclared(str(dataset.attrs.get("may_hide", "")).split())


def words_of_undeclared(may_hide: Sequence[str]) -> str:
    """Return when the second error bar holds, by the words of the key ``may_hide``; "" if there are none."""
    kinds = [_UNDECLARED.get(kind, kind) for kind in may_hide]
    words = " or ".join(filter(None, (", ".join(kinds[:-1]), *kinds[-1:])))
    return f"if an undeclared {words} cannot be excluded" if words else ""


def estimated(dataset: xr.Dataset, name: str) -> str:
    """Write the value of an unknown: to the decimal place of its first error bar, where that is a number."""
    value, low, high = _ends(dataset, name, hidden=False)
    if isfinite(low) and isfinite(high) and bool(dataset["seen"].sel(unknown=name)) and _is_number(name, value):
        return _in_numbers(dataset, name, (high - low) / 2)[0]
    return written(dataset, name, value)


def _in_numbers(dataset: xr.Dataset, name: str, half: float) -> tuple[str, str]:
    """Write the value of an unknown and half its interval in one unit, to one decimal place."""
    value = float(dataset["estimate"].sel(unknown=name))
    factor, unit = readable(max(abs(value), half), str(dataset["unit"].sel(unknown=name).values))
    first, last = barred(factor * value, factor * half, unit).split(" ± ")
    return f"{first} {unit}".rstrip(), f"± {last}"


def _is_number(name: str, value: float) -> bool:
    return _is_absolute(name) or value == 0


def bar(dataset: xr.Dataset, name: str, *, hidden: bool = False) -> str:
    """Write the error bar of an unknown: ``± 5 %``, or its ends where they are not even; "" for none."""
    value, low, high = _ends(dataset, name, hidden=hidden)
    if not (isfinite(low) and isfinite(high)):
        return ""
    half = (high - low) / 2
    if abs(high + low - 2 * value) > 2 * _UNEVEN * half:
        return span(dataset, name, low, high)
    if _is_number(name, value):
        return _in_numbers(dataset, name, half)[1]
    return f"± {percent(half / abs(value))}"


def span(dataset: xr.Dataset, name: str, low: float, high: float) -> str:
    """Write a range of an unknown, with one unit if both ends have it: ``43.6 to 45.6 kPa``."""
    for digits in (3, 4, 5, 6):
        first, last = (written(dataset, name, end, digits) for end in (low, high))
        if first != last:
            break
    number, _, unit = first.partition(" ")
    return f"{number if last.endswith(f' {unit}') else first} to {last}"


def parts(dataset: xr.Dataset, name: str) -> str:
    """Say of which sources the first error bar of an unknown is, the largest first."""
    one = dataset.sel(unknown=name)
    shares = [(float(one["part"].sel(source=source)), words) for source, words in _SOURCES.items()]
    whole = float((one["high"] - one["low"]) / 2)
    known = sorted((share, words) for share, words in shares if isfinite(share) and share > 0.005 * whole)[::-1]
    absolute = _is_absolute(name)
    size = abs(float(one["estimate"]))
    of = (f"{words} {written(dataset, name, s, 2) if absolute else percent(s / size)}" for s, words in known)
    return f"{title(name)}: {', '.join(of)}"


def mesh_share(dataset: xr.Dataset, name: str) -> float:
    """Return the mesh's part of the first error bar, as a share of it."""
    one = dataset.sel(unknown=name)
    return float(one["part"].sel(source="mesh") / ((one["high"] - one["low"]) / 2))


def _is_absolute(name: str) -> bool:
    return name.partition(" of ")[0].endswith(_ABSOLUTE) or name.startswith(_SHARES)


def title(name: str) -> str:
    """Return the name of an unknown for people: ``E``, ``E of skin``, ``contact point``."""
    owner, _, key = name.rpartition("_")
    if name in _NAMES or owner.startswith("relaxation"):
        return _NAMES.get(name, name.replace("_", " "))
    if key == "scale":
        return f"scale of the field of E{f' in {owner}' if owner else ''}"
    known = quantity_of(key)
    if owner and known:
        return f"{known.symbol or key} of {owner}"
    return (known.symbol if known else "") or name.replace("_", " ")


def written(dataset: xr.Dataset, name: str, value: float, digits: int = 3) -> str:
    """Write a value of an unknown with its unit, and a prefix that suits it."""
    return engineering(value, str(dataset["unit"].sel(unknown=name).values), digits)


def engineering(value: float, unit: str, digits: int = 3) -> str:
    """Write an SI value with a prefix: ``12.3 kPa``, ``4.5 mm``; plain numbers without one."""
    if unit in ("", "1") or not isfinite(value):
        return f"{value:.{digits}g}"
    power = 3 * floor(log10(abs(float(f"{value:.{digits}g}"))) / 3) if value else 0
    power = max(min(power, max(_PREFIXES)), min(_PREFIXES))
    scaled = f"{value / 10.0**power:#.{digits}g}".rstrip(".")
    if "e" in scaled:
        scaled = f"{float(scaled):.0f}"
    return f"{scaled} {_PREFIXES[power]}{unit}"


def readable(largest: float, unit: str) -> tuple[float, str]:
    """Return the factor from an SI unit to the one with a prefix that suits the ``largest`` value, and its name."""
    if unit in ("", "1"):
        return 1.0, ""
    number, word = engineering(largest, unit, 12).split(" ")
    return float(number) / largest if largest else 1.0, word


def is_passed_on(dataset: xr.Dataset) -> bool:
    """Return whether another study can read the material with its bars: not the scale of a field."""
    return not any(name.endswith("scale") for name in map(str, dataset["unknown"].values))


def material(dataset: xr.Dataset) -> str:
    """Return what was found of the tissue as lines of a study file; "" if there is no one material.

    ``[material]`` has what the study knew, too. Lines of layers and inclusions belong into their tables, which are
    named above them.
    """
    if "file" in dataset.dims or dataset.attrs["verdict"] != FITS:
        return ""
    known = toml_of(str(dataset.attrs.get("study", "")), "").get("material", {})
    lines: dict[str, list[str]] = {"[material]": []}
    terms: dict[str, list[str]] = {}
    for name in wanted(dataset):
        owner, _, key = name.rpartition("_")
        if not bool(dataset["seen"].sel(unknown=name)) or is_of_test(name):
            continue
        value = written(dataset, name, float(dataset["estimate"].sel(unknown=name)), 4)
        text = json.dumps(value, ensure_ascii=False) if str(dataset["unit"].sel(unknown=name).values) != "1" else value
        if owner.startswith("relaxation_"):
            terms.setdefault(key, []).append(f"{owner.removeprefix('relaxation_')} = {text}")
            continue
        second = bar(dataset, name, hidden=True)
        comment = f"{bar(dataset, name)}{f'; {second} with what may be undeclared' if second else ''}"
        heading = f'# in the table of "{owner}":' if owner else "[material]"
        if key == "scale":
            heading = f'# in the table `young` of "{owner or "material"}":'
        lines.setdefault(heading, []).append(f"{key} = {text}  # {comment}")
    if terms:
        own = ", ".join(f"{{ {', '.join(terms[key])} }}" for key in sorted(terms))
        heading = "[material]" if known or lines["[material]"] else "# in the table of each layer:"
        lines.setdefault(heading, []).append(f"relaxation = [{own}]")
    if lines["[material]"]:
        sought = {*map(str, dataset["unknown"].values), *(["relaxation"] if terms else [])}
        others = {key: value for key, value in known.items() if key not in sought}
        lines["[material]"] += [f"{to_line(key, value)}  # as known before" for key, value in others.items()]
    return "\n".join("\n".join((heading, *rows)) for heading, rows in lines.items() if rows)


def _ends(dataset: xr.Dataset, name: str, *, hidden: bool) -> tuple[float, float, float]:
    one, end = dataset.sel(unknown=name), "_hidden" if hidden else ""
    return float(one["estimate"]), float(one[f"low{end}"]), float(one[f"high{end}"])


def _curves(dataset: xr.Dataset) -> str:
    return "this curve" if dataset.sizes["measurement"] == 1 else "these curves"


def _without_bars(dataset: xr.Dataset) -> Iterator[str]:
    """Yield that the law does not fit, and E by depth."""
    yield f"The declared law {dataset.attrs['verdict']}. No value has an error bar."
    if "window" in dataset.dims:
        ends = (dataset.isel(window=number) for number in (0, -1))
        words = (
            f"{engineering(float(one['window_young']), 'Pa')} to a depth of "
            f"{engineering(float(one['window_depth']), 'm')}"
            for one in ends
        )
        yield f"E by the depth that is fitted: {', '.join(words)}."


def _of_files(dataset: xr.Dataset) -> Iterator[str]:
    """Yield how many of many curves the law fits, and medians over these."""
    fits, failed = (dataset["verdict"] == FITS).values, failures(dataset)
    yield f"{counted(dataset.sizes['file'], 'file')}: the declared law fits {int(fits.sum())}."
    if names := [str(name) for name in dataset["file"].values[~fits] if str(name) not in failed]:
        yield f"It does not fit {', '.join(names[:_MOST])}{_more(names, _MOST)}."
    if failed:
        reasons = list(failed.values())
        listed = f"{'; '.join(reasons[:_MOST_REASONS])}{_more(reasons, _MOST_REASONS)}"
        yield f"{counted(len(failed), 'file')} failed: {listed}."
    own = dataset.isel(file=np.flatnonzero(fits))
    for name in wanted(dataset) if fits.any() else ():
        one = own.sel(unknown=name)
        low, middle, high = (written(own, name, float(one["estimate"].quantile(q))) for q in (0.1, 0.5, 0.9))
        yield f"{title(name)}: median {middle}; of ten curves, eight have {low} to {high}{_median_bars(own, name)}."


def failures(dataset: xr.Dataset) -> dict[str, str]:
    """Return why files of an identification have not been fitted, by their names; of one file alone it is an error."""
    if "status" not in dataset:
        return {}
    bad = dataset.isel(file=np.flatnonzero((dataset["status"] == FAILED).values))
    return dict(zip(bad["file"].values.astype(str), bad["message"].values.astype(str), strict=True))


def _more(items: Sequence[str], most: int) -> str:
    return f" and {len(items) - most} more" if len(items) > most else ""


def _median_bars(dataset: xr.Dataset, name: str) -> str:
    one = dataset.sel(unknown=name)
    halves = [(one[f"high{end}"] - one[f"low{end}"]) / 2 for end in ("", "_hidden")]
    if _is_absolute(name):
        words = [written(dataset, name, float(half.median()), 2) for half in halves]
    else:
        words = [percent(float((half / abs(one["estimate"])).median())) for half in halves]
    first, second = (f"± {word}" if word not in ("", "nan") else "" for word in words)
    beside = f", {second} {if_undeclared(dataset)}" if second and second != first else ""
    return f". Median error bar: {first} if the body is as declared{beside}" if first else ""
