"""Files of Python beside a study: the one of a function, and the modules that it imports."""

import ast
import hashlib
from functools import lru_cache
from pathlib import Path


def function_in(function: str) -> tuple[Path, str]:
    """Return the file of a function, FILE.py:NAME, and its name there."""
    file, _, name = function.rpartition(":")
    return Path(file), name


def content_of(function: str) -> tuple[str, ...]:
    """Return the identity of a function, FILE.py:NAME: the content of its file, its name, the content of imports."""
    file, name = function_in(function)
    first, *others = (hashlib.sha256(source.read_bytes()).hexdigest() for source in with_imported(file))
    return first, name, *others


def problem_of(function: str, folder: Path) -> str:
    """Return what is wrong with a function, FILE.py:NAME in a ``folder``; "" if nothing is."""
    file, name = function_in(function)
    path = folder / file
    if not path.resolve().is_relative_to(folder.resolve()):
        return "must be a file in the folder of the study, or below it: a run executes it"
    if file.suffix != ".py" or not name.isidentifier():
        return 'must be "FILE.py:NAME"'
    return "" if path.is_file() else f"there is no file {path}"


def with_imported(file: Path) -> tuple[Path, ...]:
    """Return a file of Python, and the modules in its folder that it imports, as those import others."""
    return _with_imported(file, {file})


def _with_imported(file: Path, known: set[Path]) -> tuple[Path, ...]:
    found, folder = [file], file.parent
    for name in sorted(_imported(file.read_bytes()) if file.is_file() else ()):
        parts = folder.joinpath(*name.split("."))
        packages = [folder.joinpath(*name.split(".")[:end], "__init__.py") for end in range(1, name.count(".") + 2)]
        for module in (parts.with_suffix(".py"), *packages):
            if module not in known and module.is_file():
                known.add(module)
                found += _with_imported(module, known)
    return tuple(found)


@lru_cache(64)
def _imported(text: bytes) -> frozenset[str]:
    """Return the names that a text of Python imports, wherever in it; none if it is no Python."""
    try:
        nodes = [*ast.walk(ast.parse(text))]
    except (SyntaxError, ValueError):
        return frozenset()
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    for node in nodes:
        if isinstance(node, ast.ImportFrom):
            names |= {node.module} if node.module else set()
            names |= {".".join(filter(None, (node.module, alias.name))) for alias in node.names if alias.name != "*"}
    return frozenset(names)
