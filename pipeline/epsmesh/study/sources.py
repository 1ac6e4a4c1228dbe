"""Files of Python beside a study: the one of a function, and the modules that it imports."""

import ast
from functools import lru_cache
from pathlib import Path


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
