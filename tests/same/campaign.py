"""Many pairs: ``python -m tests.same.campaign --seeds 0:200``. What was done is not done again.

Each scene is solved once, and once more for each change that is drawn for it. Results are lines of results/same.jsonl,
the report is results/same.md, and each failure is two studies in results/same/.
"""

import argparse
import json
import math
import random
import shutil
import sys
import tempfile
import time
import traceback
from collections import Counter, defaultdict
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from epsmesh.study.toml import to_toml
from tests.isolated import isolated
from tests.pairs import Study
from tests.same import changes, files, forms  # noqa: F401 (they fill the table of changes)
from tests.same.files import write_files
from tests.same.judge import judge
from tests.same.outcome import Outcome, solve
from tests.same.pair import CHANGES, Pair
from tests.same.scenes import draw, seconds

# Changes that are tried of each scene.
_PER_SCENE = 8
_KEPT = ("differs", "one failed")
_TWO_TOOLS = ("grasp",)  # changes are written for one tool
_LIMIT = 900  # seconds that a scene may take
_FINE_LIMIT = 5.0  # seconds that a study of a pair of fine scenes may take, as planned


@dataclass(frozen=True)
class Row:
    """A pair: its scene's seed and features, the change, and what came of it.

    ``result`` is "same", "differs", "refused" (one of both, or both), "one failed", "failed" (both) or "none": no such
    pair.
    """

    seed: int
    features: tuple[str, ...]
    change: str
    result: str
    what: str = ""
    times: float = 0.0
    one_mesh: bool = True
    seconds: float = 0.0


def run_scene(
    seed: int, folder: Path, kept: Path | None = None, only: Collection[str] = (), *, fine: bool = False
) -> list[Row]:
    """Run one scene with the changes that are drawn for it; what differs is written to ``kept`` as two studies."""
    study, features = draw(seed, folder, fine=fine, without=_TWO_TOOLS)
    dice = random.Random(f"changes {seed}")
    chosen = [name for name in dice.sample([*CHANGES], len(CHANGES)) if not only or name in only]
    known: dict[str, Outcome] = {}
    rows: list[Row] = []
    for name in chosen:
        if sum(row.result != "none" for row in rows) == _PER_SCENE:
            break
        start = time.process_time()
        change_dice = random.Random(f"{name} {seed}")
        try:
            pair = CHANGES[name](study, change_dice)
        except Exception:
            rows.append(Row(seed, features, name, "differs", traceback.format_exc(limit=-2), math.inf))
            continue
        if pair is None or (fine and _seconds(pair, folder) > _FINE_LIMIT):
            continue
        row, other = _compare(Row(seed, features, name, "none"), pair, folder, known)
        rows.append(replace(row, seconds=time.process_time() - start))
        if row.result in _KEPT and kept is not None:
            keep(row, pair.first, other, kept)
    return rows


def _seconds(pair: Pair, folder: Path) -> float:
    studies = (pair.first, pair.first if callable(pair.second) else pair.second)
    return max(seconds(study, folder) for study in studies)


def _compare(row: Row, pair: Pair, folder: Path, known: dict[str, Outcome]) -> tuple[Row, Study]:
    text = json.dumps([pair.first, dict(pair.at_first)])
    if text not in known:
        known[text] = solve(pair.first, folder, at=pair.at_first)
    first = known[text]
    other = pair.second(first) if callable(pair.second) else pair.second
    with tempfile.TemporaryDirectory() as scratch:
        store = Path(scratch) / "cases.sqlite"
        if pair.before is not None:
            solve(pair.before, folder, store)
        second = solve(other, folder, store, pair.at)
    second = pair.related(second) if second.is_taken else second
    if pair.common and first.is_taken and second.is_taken:
        both = first.values.keys() & second.values.keys()
        first, second = first.only(both), second.only(both)
    kinds = {first.kind, second.kind}
    if "refused" in kinds or kinds == {"taken", "failed"}:
        wrong, result = ("refused", "refused") if "refused" in kinds else ("failed", "one failed")
        place, message = ("first", first.message) if first.kind == wrong else ("second", second.message)
        return replace(row, result=result, what=f"{place}: {message}"[:400]), other
    verdict = judge(first, second, one_mesh=pair.one_mesh, allowed=pair.allowed)
    result = "differs" if not verdict.agrees else "same" if first.is_taken else "failed"
    return replace(row, result=result, what=verdict.what, times=verdict.times, one_mesh=verdict.is_one_mesh), other


def keep(row: Row, first: Study, second: Study, folder: Path) -> None:
    """Write the two studies of a pair that differs, with what differs above them."""
    name = f"{row.seed:05d}-{row.change.replace(',', '').replace(' ', '-')}"
    for part, study in (("a", first), ("b", second)):
        note = f"# {' + '.join(row.features)}: {row.change}: {row.what.splitlines()[-1] if row.what else ''}\n"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{name}-{part}.toml").write_text(note + to_toml(study, "same.toml"), encoding="utf-8")


def report(rows: Sequence[Row]) -> str:
    """Return the table of change by feature: how many of how many pairs give the same results."""
    pairs = [row for row in rows if row.result in ("same", "differs")]
    count = Counter(row.result for row in rows)
    lines = [
        f"# The same thing said twice: {count['same']} of {len(pairs)} pairs give the same results", "",
        f"Also {count['refused']} of which one study or both are refused, {count['one failed']} of which one failed, "
        f"{count['failed']} of which both failed.", "",
        "| change | same | on one mesh | largest difference / allowed | refused |", "|---|---|---|---|---|",
    ]  # fmt: skip
    for change in sorted({row.change for row in rows}):
        own = [row for row in pairs if row.change == change]
        refused = sum(row.change == change and row.result == "refused" for row in rows)
        worst = max((row.times for row in own), default=0.0)
        same, one_mesh = sum(row.result == "same" for row in own), sum(row.one_mesh for row in own)
        lines.append(f"| {change} | {same} of {len(own)} | {one_mesh} | {worst:.2g} | {refused} |")
    table: dict[str, Counter[str]] = defaultdict(Counter)
    for row in pairs:
        for feature in row.features:
            table[feature][row.result] += 1
    lines += ["", "| feature | same |", "|---|---|"]
    lines += [f"| {name} | {table[name]['same']} of {table[name].total()} |" for name in sorted(table)]
    lines += ["", "| seed | features | change | differs in, or failed |", "|---|---|---|---|"]
    for row in rows:
        if row.result in _KEPT:
            what = " ".join(row.what.split()).replace("|", "/")[-300:]
            lines.append(f"| {row.seed} | {' + '.join(row.features)} | {row.change} | {row.times:.3g} × : {what} |")
    return "\n".join(lines) + "\n"


def _in_process(seed: int, folder: str, kept: str, only: Collection[str], fine: bool) -> list[Row]:
    return run_scene(seed, Path(folder), Path(kept), only, fine=fine)


def main() -> int:
    """Run the scenes of some seeds, and write the report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="0:20", help="FIRST:END of the scenes' seeds")
    parser.add_argument("--change", action="append", default=[], help="this change only; may be repeated")
    parser.add_argument("--fine", action="store_true", help="scenes of smaller elements, mostly on the meridian")
    parser.add_argument("--output", type=Path, default=Path("results"))
    arguments = parser.parse_args()
    arguments.output.mkdir(exist_ok=True)
    log = arguments.output / "same.jsonl"
    rows = [Row(**json.loads(line)) for line in log.read_text().splitlines()] if log.exists() else []
    done = {row.seed for row in rows}
    first, end = map(int, arguments.seeds.split(":"))
    kept = str(arguments.output / "same")
    with tempfile.TemporaryDirectory() as folder, log.open("a", encoding="utf-8") as file:
        write_files(Path(folder))
        seeds = (seed for seed in range(first, end) if seed not in done)
        items = ((seed, folder, kept, arguments.change, arguments.fine) for seed in seeds)
        for (seed, *_), found in isolated(_in_process, items, _LIMIT):
            if isinstance(found, Exception):
                new = [Row(seed, (), "any", "differs", f"the process ended: {found!r}", math.inf)]
            else:
                new = found or [Row(seed, (), "any", "none")]
            rows += new
            for row in new:
                print(json.dumps(asdict(row)), file=file, flush=True)
    if not any(row.result == "differs" for row in rows):
        shutil.rmtree(arguments.output / "same", ignore_errors=True)
    text = report(rows)
    (arguments.output / "same.md").write_text(text, encoding="utf-8")
    print("\n".join(text.splitlines()[:3]))
    return int(any(row.result == "differs" for row in rows))


if __name__ == "__main__":
    sys.exit(main())
