"""What ``run`` says before and after: what is to be done, and what came of it."""

from collections import Counter
from shlex import quote
from typing import TYPE_CHECKING, Any, TextIO

from pipeline import stages
from pipeline.cli.console import error
from pipeline.cli.words import axes_of, warn
from pipeline.plan.plan import Plan
from pipeline.plan.shard import Shard
from pipeline.printable import counted
from pipeline.run.remaining import format_seconds

if TYPE_CHECKING:
    from pipeline.workflow import Opened, Outcome

# Failed cases beyond these are counted only: `status` lists them all.
_MOST_FAILURES = 20
# Reasons beyond these are left out of a line.
_MOST_REASONS = 2


def announce(plan: Plan, opened: "Opened", *, quiet: bool, verbose: bool) -> None:
    """Say, before the run, what is to be done and what is not, and why."""
    for notice in opened.notices:
        error(notice)
    if quiet:
        return
    study = plan.study
    warn(study)
    print(f"{study.title}: {counted(len(plan.keys), 'case')}{axes_of(study)}")
    for struck in plan.struck:
        print(f"  {struck.name:13} {struck.count:6}  {struck.reason}")
    if study.solve.timing:
        print(f"  timing: every case afresh and alone, median of {study.solve.repeats}; nothing is struck out")
    if plan.solves:
        steps = plan.meshes
        print(f"  to do: {counted(len(steps), 'mesh')}, {counted(len(plan.solves), 'solve')}", flush=True)
        for number, step in enumerate(steps if verbose else (), start=1):
            print(f"    step {number}: {counted(len(step.solves), 'solve')}: {step.solves[0].label}", flush=True)


def as_data(plan: Plan, opened: "Opened", outcome: "Outcome", seconds: float) -> dict[str, Any]:
    """Return what came of a study as plain data."""
    return {
        "study": plan.study.file,
        "warnings": list(plan.study.warnings),
        "cases": len(plan.keys),
        **outcome.counts,
        "stored": sum(key in plan.stored for key in plan.keys),
        "failures": [{"case": case, "message": message} for case, message in outcome.failures],
        "skipped_because": list(_reasons(plan, opened, "skipped")),
        "files": [str(file) for file in outcome.files],
        "seconds": round(seconds, 3),
        "interrupted": outcome.interrupted,
    }


def conclude(
    plan: Plan, opened: "Opened", outcome: "Outcome", seconds: float, shard: Shard | None, *, quiet: bool
) -> None:
    """Say, after the run, what came of it and where it is."""
    for case, message in outcome.failures[:_MOST_FAILURES]:
        error(f"failed: {case}: {message}")
    study = plan.study
    if len(outcome.failures) > _MOST_FAILURES:
        error(f"… and {len(outcome.failures) - _MOST_FAILURES} more: `epsmesh status {quote(study.file)}` lists them")
    if not quiet:
        print(_line(plan, opened, outcome, seconds, shard), flush=True)
    if outcome.interrupted:
        cases = sum(outcome.counts.values())
        done = cases - outcome.counts["pending"]
        again = f"`epsmesh run {quote(study.file)}{f' --shard {shard}' if shard else ''}` goes on from there"
        error(f"interrupted: {done} of {cases} cases are on record; {again}")


def print_stages(stream: TextIO) -> None:
    """Print where the time of this process went."""
    for name, seconds, share in stages.table():
        print(f"{seconds:10.2f} s  {100 * share:5.1f} %  {name}", file=stream)


def _line(plan: Plan, opened: "Opened", outcome: "Outcome", seconds: float, shard: Shard | None) -> str:
    """Return one line: cases done, failed, skipped and why, where the files are, and how long it took."""
    counts = []
    for state, count in outcome.counts.items():
        if not count and state != "failed":
            continue
        reasons = _reasons(plan, opened, state)
        why = "; ".join(text for text, _ in reasons.most_common(_MOST_REASONS) if text)
        more = "; …" if len(reasons) > _MOST_REASONS else ""
        counts.append(f"{count} {state}{f' ({why}{more})' if why and state in ('failed', 'skipped') else ''}")
    stored = sum(key in plan.stored for key in plan.keys)
    read_back = f" ({stored} read back)" if stored else ""
    found = ", ".join(counts)
    if shard:
        # A shard may hold F_exact and no case, or nothing where there are fewer steps than shards.
        found = found if sum(outcome.counts.values()) else "F_exact" if plan.part else "nothing to do"
        where = f"kept for `epsmesh merge {quote(plan.study.file)}`, when all shards are done"
        return f"{plan.study.file}, shard {shard}: {found}{read_back}; {where}; {format_seconds(seconds)}"
    files = ", ".join(map(str, outcome.files))
    return f"{plan.study.file}: {found}{read_back}; wrote {files}; {format_seconds(seconds)}"


def _reasons(plan: Plan, opened: "Opened", status: str) -> Counter[str]:
    """Count the messages of the cases with a status."""
    found = (opened.records[key] for key in plan.keys if key in opened.records)
    return Counter(record.message for record in found if record.status == status)
