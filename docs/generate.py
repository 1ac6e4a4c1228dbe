"""The reference pages, written from the code when the documentation is built: study keys, dataset, commands."""

import re
from pathlib import Path
from typing import Any

import typer

from epsmesh.cli import app
from epsmesh.quantities import RESERVED, RUN, attributes
from epsmesh.study.capabilities.features import FEATURES
from epsmesh.study.capabilities.obstacles import OBSTACLES
from epsmesh.study.capabilities.refusals import REFUSALS
from epsmesh.study.json_schema import schema_text
from epsmesh.study.keys import all_sections, heading, keys_of, text_of
from epsmesh_identify.estimation.dataset import WORDS

# Tables that campaigns wrote; the site has copies.
_TABLES = sorted((Path(__file__).parents[1] / "benchmarks" / "results").glob("*.md"))
# Variables without the attribute `units` that are not text.
_WITHOUT_UNIT = {"status": "flag", "stiffness": "several", "stiffness_error": "several"}


def write_reference(folder: Path) -> None:
    """Write the pages of the reference into ``folder``, where they differ from what is there."""
    folder.mkdir(exist_ok=True)
    pages = {"study": study_page, "features": features_page, "dataset": dataset_page, "commands": commands_page}
    texts = {f"{name}.md": page() for name, page in pages.items()}
    texts["study.schema.json"] = schema_text()
    texts |= {f"results/{table.name}": f"---\norphan: true\n---\n\n{table.read_text('utf-8')}" for table in _TABLES}
    (folder / "results").mkdir(exist_ok=True)
    for name, text in texts.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def study_page() -> str:
    """Return the page of every key of a study file."""
    lines = [
        "# Study file",
        "",
        "A study file is TOML: a `title`, then sections. A sweep is a dimension of the dataset. There are three kinds:",
        "",
        "- a list in place of one value: `poisson = [0.3, 0.45]`;",
        '- a range: `depth = {from = "0.1 mm", to = "1 mm", steps = 10}`, also within a list: '
        '`epsilon = [{from = "4 mm", to = "10 mm", steps = 4}, "full"]`;',
        "- an array of tables, labelled by their `name`: `[[body]]`, `[[material]]`, `[[probe]]`, `[[mesh]]` "
        "or `[[load]]`.",
        "",
        'A quantity is text, one number and one unit: `"10 mm"`, `"12 kPa"`, `"1 %"`, `"60 deg"`. Units are metre and '
        "pascal with their prefixes, `bar`, `%`, `deg` and `rad`; for loads kg/m^3 and m/s^2. Decimal commas, ± and "
        "sums are errors.",
        "",
        "Editors with the taplo language server (VS Code: Even Better TOML) complete and check keys by the JSON schema "
        "{download}`study.schema.json`. `epsmesh new` writes it beside each study, with the line "
        "`#:schema ./study.schema.json`.",
    ]
    for section in all_sections():
        lines += [
            "",
            f"## `{heading(section)}`",
            "",
            text_of(section),
            "",
            *_table(("key", "takes", "default", "meaning")),
        ]
        for key in keys_of(section):
            default = key.default or "required"
            shown = default if key.words.default or not key.default else f"`{default}`"
            text = f"*{', '.join(key.shapes)}*: {key.words.text}" if key.shapes else key.words.text
            lines.append(_row(f"`{key.name}`", f"`{key.takes}`", shown, text))
    return "\n".join(lines) + "\n"


def features_page() -> str:
    """Return the page of what does not go together in one study, and of what is computed the long way."""
    lines = [
        "# What goes together", "",
        "Features that exclude each other. A study with both is an error; the message has key and reason. All other "
        "pairs are computed. `free` and `fixed` mesh a column of radius ε, `halfspace` and `green` a half ball. The "
        "meridian is the half plane through the axis of a round scene.",
        "",
        *_table(("feature", "with", "key", "reason, and what to write instead")),
    ]  # fmt: skip
    lines += [_row(r.first, r.second, f"`{FEATURES[r.first].key}`", _escaped(r.reason)) for r in REFUSALS]
    lines += ["", "Features that exclude a faster method, or a real-time model:", ""]
    lines += _table(("method", "not with", "reason"))
    lines += [
        _row(way, feature, _escaped(reason.replace("{key}", FEATURES[feature].key)))
        for way, found in OBSTACLES.items()
        for feature, reason in found.items()
    ]
    return "\n".join(lines) + "\n"


def dataset_page() -> str:
    """Return the page of every variable of a dataset."""
    found = {name: attributes(name) for name in RESERVED}
    lines = [
        "# Dataset",
        "",
        "`results/<study>.nc`: netCDF4, SI units, CF-1.8. The root group has the results; the group `run` has what "
        "each case cost and how its force was obtained. `epsmesh.open` reads both as one dataset, with `status` in "
        "words.",
        "",
        "Dimensions are the swept keys, in the file's order. Coordinates are named like the keys. "
        "A variable has only the dimensions that it depends on. An array of tables gives the dimension `body`, "
        "`material`, `probe` or `mesh`; a radius or shape is `probe_radius`, `body_radius`; a key of a layer or an "
        "inclusion begins with its name: `skin_young`. A path gives the dimension `path`, a raster `x` and "
        "`y`: lengths in m, "
        "and `at_x`, `at_y` and `at_z` are then coordinates.",
        "",
        "`epsilon` is infinite for the full order. `dataset.epsmesh.finite_epsilon()` omits it, for `interp` and "
        "maps over ε.",
        "",
        "Error bars are absolute, in the unit of their value. The value names its bar in `ancillary_variables`. "
        '`dataset.epsmesh.relative("force_error")` returns one as a share.',
        "",
        'Variables of loads, slits, unilateral contact, a support that lets go, two jaws, a history, `motion = "all"`, '
        "several laws, a surface of triangles or a repaired file exist only where the study has these.",
    ]
    groups = {"Results": sorted(found.keys() - {*RUN}), "Group `run`": [name for name in RUN if name in found]}
    for title, names in groups.items():
        lines += ["", f"## {title}", "", *_table(("variable", "unit", "meaning"))]
        for name in names:
            unit = found[name].get("units", _WITHOUT_UNIT.get(name, "text"))
            lines.append(_row(f"`{name}`", "" if unit == "1" else unit, found[name].get("long_name", "")))
    lines += ["", "## Identification", "", "`results/<study>.nc` of `epsmesh identify`; many files are the dimension "
              "`file`.", "", *_table(("variable", "unit", "meaning"))]  # fmt: skip
    lines += [_row(f"`{name}`", "" if unit == "1" else unit, meaning) for name, (unit, meaning) in WORDS.items()]
    lines += [
        "",
        "Values are missing (NaN; -1 for counts) where a case failed, was skipped or has not been run. Where a "
        "path is off the body, `status` is `no contact` and `force` 0.",
        "",
        "Attributes of the dataset: the study's text (`study`) and its hash, versions of the program and its "
        "libraries, git commit, host, ranks, start and end.",
    ]
    return "\n".join(lines) + "\n"


# A default that a help text names.
_DEFAULT = re.compile(r" \[default:? ([^\]]*)\]")


def commands_page() -> str:
    """Return the page of every command with its arguments and options."""
    root: Any = typer.main.get_command(app)
    lines = [
        "# Commands",
        "",
        "`epsmesh COMMAND --help` prints the same. `python -m epsmesh` is the same command.",
        "",
        "Exit status: 0 done, 1 some cases failed, 2 the input is wrong, 130 interrupted. "
        "Errors and progress go to standard error. `NO_COLOR=1` switches colours off.",
    ]
    for name, command in root.commands.items():
        lines += ["", f"## `epsmesh {name}`", "", *_help(command.help or "")]
        rows = [row for parameter in command.params if (row := _parameter(parameter))]
        if rows:
            lines += [*_table(("", "meaning", "default")), *rows]
    return "\n".join(lines) + "\n"


def _help(text: str) -> list[str]:
    """Return a help text with its examples as a block."""
    paragraphs = [" ".join(paragraph.split()) for paragraph in text.split("\n\n")]
    examples = [p.removeprefix("Example: ") for p in paragraphs if p.startswith("Example: ")]
    lines = [line for p in paragraphs if not p.startswith("Example: ") for line in (_escaped(p), "")]
    return [*lines, "```text", *examples, "```", ""]


def _parameter(parameter: Any) -> str:
    if "--help" in parameter.opts:
        return ""
    required = parameter.param_type_name == "argument"
    name = parameter.metavar or parameter.opts[0].upper() if required else ", ".join(reversed(parameter.opts))
    name = "/".join((name, *parameter.secondary_opts))
    if not required and parameter.metavar:
        name = f"{name} {parameter.metavar}"
    said = _DEFAULT.search(parameter.help or "")
    default = _escaped(said[1]) if said else "no" if parameter.default is False else f"`{parameter.default or 'none'}`"
    text = _escaped(_DEFAULT.sub("", parameter.help or ""))
    return _row(f"`{name}`", text, "required" if parameter.required else default)


def _table(heads: tuple[str, ...]) -> list[str]:
    return [_row(*heads), _row(*("---" for _ in heads))]


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"


def _escaped(text: str) -> str:
    """Keep ``<study>`` from being taken for HTML, and file patterns for emphasis."""
    return re.sub(r"([<*_\[\]])", r"\\\1", text)
