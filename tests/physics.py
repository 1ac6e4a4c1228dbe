"""Hashes of the sources that forces and error bars depend on: a change of them is noticed, and PHYSICS_VERSION raised.

``python -m tests.physics`` writes them to tests/physics.txt, a line for each source. Comments, docstrings, formatting
and the messages of errors have no effect on them, nor has the version of Python.
"""

import ast
import hashlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from epsmesh.plan.key import PHYSICS_VERSION

ROOT = Path(__file__).parent.parent
FILE = ROOT / "tests" / "physics.txt"
# Folders and files of pipeline/epsmesh/ between a case and its record.
SOURCES = (
    *("shapes", "scene", "mesh", "solve", "insertion", "compat", "fitted.py", "viscoelastic.py", "units.py"),
    *(f"study/{name}.py" for name in ("case", "closure", "loads", "output", "slit", "stages", "sweep")),
    *(f"plan/{name}.py" for name in ("far_fields", "ladders", "recipe", "reductions", "refinement", "symmetry")),
    *(
        f"run/{name}.py"
        for name in ("attempts", "basis", "far_field", "fields", "loads", "measure", "meshing", "outputs")
    ),
    *(f"run/{name}.py" for name in ("problem", "record", "runner", "samples", "solved", "tools")),
)
COMMAND = "python -m tests.physics"
# Fields of syntax trees without effect, or that some versions of Python have.
_UNREAD = {"annotation", "returns", "type_comment", "type_params", "kind", "ctx"}
_C_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)


def hashes() -> dict[str, str]:
    """Return the hash of each source, by its path from the project's folder; the version is one of them."""
    found = {path.relative_to(ROOT).as_posix(): _hash(path) for path in sorted(_files())}
    return {"PHYSICS_VERSION": str(PHYSICS_VERSION), **found}


def recorded() -> dict[str, str]:
    """Return what was written last."""
    return dict(line.split() for line in FILE.read_text().splitlines())


def _files() -> Iterator[Path]:
    for source in SOURCES:
        path = ROOT / "pipeline" / "epsmesh" / source
        assert path.exists(), f"tests/physics.py names pipeline/epsmesh/{source}, which does not exist"
        yield from (path,) if path.is_file() else (one for end in ("py", "c", "h") for one in path.rglob(f"*.{end}"))


def _hash(path: Path) -> str:
    text = path.read_text(encoding="utf-8")
    content = plain(ast.parse(text)) if path.suffix == ".py" else " ".join(_C_COMMENT.sub(" ", text).split())
    return hashlib.sha256(content.encode()).hexdigest()[:16]


def plain(node: Any) -> str:
    """Return a syntax tree as text: what is computed, without docstrings, annotations and what errors say."""
    if isinstance(node, list):
        return f"[{','.join(map(plain, node))}]"
    if not isinstance(node, ast.AST):
        return repr(node)
    if isinstance(node, ast.Raise):
        return "raise"
    fields = {name: value for name, value in ast.iter_fields(node) if name not in _UNREAD and value not in (None, [])}
    if (
        isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and ast.get_docstring(node, clean=False) is not None
    ):
        fields["body"] = node.body[1:]
    return f"{type(node).__name__}({','.join(f'{name}={plain(value)}' for name, value in fields.items())})"


if __name__ == "__main__":
    FILE.write_text("".join(f"{name} {value}\n" for name, value in hashes().items()))
