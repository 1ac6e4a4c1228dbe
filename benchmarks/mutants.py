"""Mutation test: random changes of the numerical code, and whether the tests detect them.

    python -m benchmarks.mutants [--seed 1] [--count 20] [--room solve]...

Draws lines of the rooms by a seed and changes an operator, a comparison or a number in each, one at a time, in a
scratch copy of the checkout. Then it runs the room's tests up to the first failure. A change that survives is either
equivalent or affects a number that no test checks: inspect it. The table is written to ``results/mutants.md``.
"""

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[1]
_ROOMS = {"epsmesh": ("solve", "mesh", "scene", "shapes", "plan"), "epsmesh_realtime": ("export",)}
ROOMS = {room: ROOT / "pipeline" / package / room for package, rooms in _ROOMS.items() for room in rooms}
_COPIED = ("pipeline", "tests", "benchmarks", "studies", "meshes", "docs", "pyproject.toml")
_SECONDS = 900  # a change whose tests take longer counts as hanging
_SWAPS: dict[type, type] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.And: ast.Or,
    ast.Or: ast.And,
}


@dataclass(frozen=True)
class Mutant:
    """The ``file`` with its source replaced by ``text``, which changes ``line``."""

    file: Path
    line: int
    text: str

    @property
    def changed(self) -> str:
        """The changed line."""
        return self.text.splitlines()[self.line - 1].strip()


def main(arguments: list[str]) -> int:
    """Draw, test, and write the table; return 2 if the tests fail without any change."""
    options = _options(arguments)
    draw = random.Random(options.seed)
    rooms = options.room or ROOMS
    files = [(room, file) for room in rooms for file in sorted(ROOMS[room].rglob("*.py"))]
    mutants = [(room, mutant) for room, file in files for mutant in _mutants(file)]
    chosen = draw.sample(mutants, min(options.count, len(mutants)))
    rows = []
    with TemporaryDirectory(prefix="epsmesh-mutants-") as folder:
        tree = Path(folder) / "tree"
        tree.mkdir()
        for name in _COPIED:
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            copy(ROOT / name, tree / name)
        for room in rooms:
            if verdict := _run(tree, room):
                print(f"the tests of {room} fail as they are: {verdict}", file=sys.stderr)
                return 2
        for room, mutant in chosen:
            place = tree / mutant.file.relative_to(ROOT)
            place.write_text(mutant.text)
            verdict = _run(tree, room)
            shutil.copy(mutant.file, place)
            rows.append((f"{mutant.file.relative_to(ROOT)}:{mutant.line}", mutant.changed, verdict or "SURVIVES"))
            print(*rows[-1], sep="  ", flush=True)
    killed = sum(verdict != "SURVIVES" for _, _, verdict in rows)
    lines = [
        f"{killed} of {len(rows)} changes noticed, seed {options.seed}",
        "",
        "| place | change | by |",
        "|---|---|---|",
    ]
    (ROOT / "results").mkdir(exist_ok=True)
    (ROOT / "results" / "mutants.md").write_text(
        "\n".join([*lines, *(f"| {a} | `{b}` | {c} |" for a, b, c in rows), ""])
    )
    print(lines[0])
    return 0


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutants", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--room", action="append", choices=ROOMS, help="only this folder of pipeline/epsmesh/")
    return parser.parse_args(arguments)


def _mutants(file: Path) -> Iterator[Mutant]:
    """Yield every mutant of a file: operators and comparisons swapped, numbers doubled; strings and types unchanged."""
    source = file.read_text()
    lines = source.splitlines(keepends=True)
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line.encode()))
    raw = source.encode()

    def at(node: ast.expr) -> slice:
        assert node.end_lineno is not None and node.end_col_offset is not None
        return slice(starts[node.lineno - 1] + node.col_offset, starts[node.end_lineno - 1] + node.end_col_offset)

    for function in (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef)):
        for node in (child for statement in function.body for child in ast.walk(statement)):
            if (new := _swapped(node)) is not None and isinstance(node, ast.expr) and node.lineno == node.end_lineno:
                place = at(node)
                text = raw[: place.start] + f"({ast.unparse(new)})".encode() + raw[place.stop :]
                yield Mutant(file, node.lineno, text.decode())


def _swapped(node: ast.AST) -> ast.expr | None:
    if isinstance(node, ast.BinOp) and type(node.op) in _SWAPS:
        return ast.BinOp(node.left, _SWAPS[type(node.op)](), node.right)
    if isinstance(node, ast.BoolOp):
        return ast.BoolOp(_SWAPS[type(node.op)](), node.values)
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in _SWAPS:
        return ast.Compare(node.left, [_SWAPS[type(node.ops[0])]()], node.comparators)
    if isinstance(node, ast.Constant) and isinstance(node.value, float) and node.value:
        return ast.Constant(2 * node.value)
    return None


def _run(tree: Path, room: str) -> str:
    """Return the first test of a room that fails, "it hangs", or "" if all pass."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", f"tests/{room}"]
    if not (tree / "tests" / room).exists():
        command[-1] = "tests/mesh"  # tests of meshes cover scenes
    # The copy's packages, before those that are installed.
    environment = {**os.environ, "PYTHONPATH": f"{tree / 'pipeline'}:{tree}", "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        found = subprocess.run(
            command,
            cwd=tree,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=_SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return "it hangs"
    failed = [line for line in found.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return "" if found.returncode == 0 else (failed or ["the tests do not run"])[0].partition(" - ")[0]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
