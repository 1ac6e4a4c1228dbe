"""A real-time model as a co-simulation unit of FMI 3.0: a zip file with description, library, sources and the model.

The unit has one tool, whose kind and sizes are parameters. A step evaluates the inputs at its beginning.
"""

import os
import platform
import shlex
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass, field
from functools import cache
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree as Xml

from epsmesh.files import MODEL_ENDING, atomic
from epsmesh_realtime import source_files, sources
from epsmesh_realtime.model import Model, model_of

NAME = "epsmesh"
MODEL_FILE = "model.epsm"  # the same in pipeline/epsmesh_realtime/c/fmu/fmi3.c, as is the token
TOKEN = "{epsmesh-realtime-fmi3-1}"
# What is compiled; epsmesh.c includes what is in src/.
_COMPILED = ("fmu/fmi3.c", "epsmesh.c")
_FLAGS = ("-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden")
# The tool with which a unit begins: radius, length and width, in units of the way to the nearest side or the bottom.
_SIZES = {"radius": 0.12, "length": 0.3, "width": 0.03}
_ANGLE = 1.0
_UNITS = {
    "m": {"m": 1},
    "s": {"s": 1},
    "rad": {"rad": 1},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N/m": {"kg": 1, "s": -2},
}
# In the order of epsmesh_shape and epsmesh_status.
SHAPES = ("disc", "sphere", "cone", "blade", "bonded disc")
STATUSES = (
    "ok", "no contact", "outside", "large", "deep", "tool", "input", "poisson", "tilted", "off", "damaged", "no model",
    "near", "others", "alone", "history",
)  # fmt: skip


class NoCompilerError(Exception):
    """There is no C compiler, or it failed: the message says so."""


@dataclass(frozen=True)
class Variable:
    """A variable of the unit; ``reference`` is its place in the list."""

    name: str
    causality: str
    unit: str
    description: str
    start: float | None = None
    kind: str = "Float64"
    range: tuple[float, float] = field(default=(-inf, inf))


def variables(model: Model) -> list[Variable]:
    """Return the unit's variables in the order of their references, with the ``model``'s values to start from."""
    room = min(*model.sides, model.thickness)
    x, y, z = model.origin.tolist()
    tip, axis, along = (
        "lowest point of the tool",
        "direction of pressing; 0, 0, 0: inward normal",
        "direction of a blade",
    )
    found = [Variable("time", "independent", "s", "time")]
    for name, text, start in (("tip", tip, (x, y, z)), ("axis", axis, (0.0,) * 3), ("along", along, (0.0,) * 3)):
        unit = "m" if name == "tip" else ""
        found += [
            Variable(f"{name}.{c}", "input", unit, f"{text}, {c} of the body", s)
            for c, s in zip("xyz", start, strict=True)
        ]
    found += [
        Variable("young", "input", "Pa", "Young's modulus of the tissue at the face", model.young),
        Variable("poisson", "input", "", "Poisson's ratio", model.poisson, range=model.table.poisson),
        Variable(
            "radius", "parameter", "m", "radius of a disc, a sphere or the end of a cone", _SIZES["radius"] * room
        ),
        Variable("angle", "parameter", "rad", "half angle of a cone to its axis", _ANGLE),
        Variable("length", "parameter", "m", "length of a blade's edge", _SIZES["length"] * room),
        Variable("width", "parameter", "m", "width of a blade's edge", _SIZES["width"] * room),
    ]
    found += [Variable(f"force.{c}", "output", "N", f"force of the tissue on the tool, {c} of the body") for c in "xyz"]
    found += [
        Variable("force_error", "output", "N", "95 % error bar of the force along the normal"),
        Variable("stiffness", "output", "N/m", "dF/dd at a fixed place"),
        Variable("contact_radius", "output", "m", "radius of the contact"),
        Variable("depth", "output", "m", "depth below the undeformed face, along its normal"),
        Variable("shape", "parameter", "", "kind of the tool", SHAPES.index("sphere"), "Enumeration"),
        Variable("status", "output", "", "ok, no contact, or why there is no answer", kind="Enumeration"),
    ]
    return found


def describe(model: Model, name: str, version: str) -> str:
    """Return modelDescription.xml of a ``model``."""
    root = Xml.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=name,
        instantiationToken=TOKEN,
        description="Force of soft tissue on a tool, with an error bar: a real-time model of epsmesh",
        generationTool=f"epsmesh {version}",
        variableNamingConvention="structured",
    )
    Xml.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=NAME,
        canHandleVariableCommunicationStepSize="true",
        canGetAndSetFMUState="true",
    )
    _units(root)
    _types(root)
    logs = Xml.SubElement(root, "LogCategories")
    for category in ("logStatusWarning", "logStatusError"):
        Xml.SubElement(logs, "Category", name=category)
    Xml.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize="0.001")
    listed, structure = Xml.SubElement(root, "ModelVariables"), Xml.SubElement(root, "ModelStructure")
    all_of_them = list(enumerate(variables(model)))
    for reference, variable in all_of_them:
        Xml.SubElement(listed, variable.kind, _attributes(variable, reference))
    for kind in ("Output", "InitialUnknown"):
        for reference, variable in all_of_them:
            if variable.causality == "output":
                Xml.SubElement(structure, kind, valueReference=str(reference))
    return _text(root)


def _units(root: Xml.Element) -> None:
    units = Xml.SubElement(root, "UnitDefinitions")
    for name, powers in _UNITS.items():
        Xml.SubElement(Xml.SubElement(units, "Unit", name=name), "BaseUnit", {k: str(v) for k, v in powers.items()})


def _types(root: Xml.Element) -> None:
    types = Xml.SubElement(root, "TypeDefinitions")
    for name, words in (("Shape", SHAPES), ("Status", STATUSES)):
        kind = Xml.SubElement(types, "EnumerationType", name=name)
        for value, word in enumerate(words):
            Xml.SubElement(kind, "Item", name=word, value=str(value))


def _attributes(variable: Variable, reference: int) -> dict[str, str]:
    found = {"name": variable.name, "valueReference": str(reference), "causality": variable.causality}
    found["description"] = variable.description
    if variable.kind == "Enumeration":
        found |= {"declaredType": variable.name.capitalize(), "variability": "discrete"}
    if variable.causality == "parameter":
        found["variability"] = "tunable"
    if variable.unit:
        found["unit"] = variable.unit
    if variable.start is not None:
        found["start"] = repr(variable.start)
    found |= {k: repr(v) for k, v in zip(("min", "max"), variable.range, strict=True) if abs(v) < inf}
    return found


def build_description() -> str:
    """Return sources/buildDescription.xml."""
    root = Xml.Element("fmiBuildDescription", fmiVersion="3.0")
    build = Xml.SubElement(root, "BuildConfiguration", modelIdentifier=NAME)
    files = Xml.SubElement(build, "SourceFileSet", language="C99")
    for name in _COMPILED:
        Xml.SubElement(files, "SourceFile", name=Path(name).name)
    Xml.SubElement(build, "Library", name="m")
    return _text(root)


def _text(root: Xml.Element) -> str:
    Xml.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"


def library_place() -> str:
    """Return the folder and the name of this machine's library in a unit.

    Raises:
        NoCompilerError: if the standard has no name for this machine, or the unit was not tried on it.
    """
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    system, ending = {"linux": ("linux", "so"), "darwin": ("darwin", "dylib")}.get(sys.platform, ("", ""))
    if not system or machine not in ("x86_64", "aarch64"):
        raise NoCompilerError(
            f"a unit cannot be made on {sys.platform}, {machine}: Linux and macOS on x86_64 and aarch64"
        )
    return f"binaries/{machine}-{system}/{NAME}.{ending}"


def compiler() -> list[str]:
    """Return the command of a C compiler: $CC, or `cc`.

    Raises:
        NoCompilerError: if there is none.
    """
    command = shlex.split(os.environ.get("CC", "")) or ["cc"]
    if shutil.which(command[0]) is None:
        raise NoCompilerError(
            f"a unit contains a compiled library, and there is no C compiler {command[0]!r}: install gcc, or set CC"
        )
    return command


@cache
def _library(command: tuple[str, ...]) -> bytes:
    """Return the compiled evaluator with the functions of the standard.

    Raises:
        NoCompilerError: if it does not compile.
    """
    with TemporaryDirectory() as folder:
        made, code = Path(folder) / NAME, [str(sources() / each) for each in _COMPILED]
        options = [*_FLAGS, f"-I{sources()}", *code, "-o", str(made), "-lm"]
        done = subprocess.run([*command, *options], capture_output=True, text=True, check=False)
        if done.returncode:
            raise NoCompilerError(f"{command[0]} failed: {done.stderr.strip()[-500:]}")
        return made.read_bytes()


def write_fmu(model_file: Path, path: Path, version: str) -> None:
    """Write the unit of the model in ``model_file`` to ``path``; the file appears whole or not at all.

    Raises:
        NoCompilerError: if there is no compiler for this machine, or it failed.
        ModelError: if ``model_file`` is no model; OSError if a file cannot be read or written.
    """
    data = model_file.read_bytes()
    model, place, library = model_of(data), library_place(), _library(tuple(compiler()))
    name = model_file.name.removesuffix(MODEL_ENDING)
    with atomic(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as unit:
        unit.writestr("modelDescription.xml", describe(model, name, version))
        unit.writestr("sources/buildDescription.xml", build_description())
        unit.writestr(f"resources/{MODEL_FILE}", data)
        unit.writestr(place, library)
        for each in source_files():
            if str(each) in _COMPILED or each.match("epsmesh*.h") or each.parent.name == "src":
                unit.write(sources() / each, f"sources/{str(each).removeprefix('fmu/')}")
