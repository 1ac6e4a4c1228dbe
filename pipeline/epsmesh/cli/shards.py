"""`status --merge`: merge the shards of a study, and print the commands that compute missing cases."""

from datetime import UTC, datetime
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, NoReturn

import typer

from epsmesh.cli.console import error, is_json_wanted, say
from epsmesh.cli.faults import DONE, SOME_FAILED, fail, of_file, of_results, refusing
from epsmesh.cli.words import CLUSTER, check_names, check_output, read_all, store_to_write
from epsmesh.files import result_files
from epsmesh.printable import counted
from epsmesh.states import FAILURES

if TYPE_CHECKING:
    from epsmesh.plan.plan import Plan
    from epsmesh.run.merge import Source
    from epsmesh.run.record import Record
    from epsmesh.study.sweep import Study

# Longer lists of pending cases than this are cut.
_MOST_CASES = 10


def merge_shards(
    file: Path, stores: list[Path] | None, output: Path, target: Path, without: list[str] | None
) -> NoReturn:
    """Merge the ``stores`` of a study's shards into ``target``, write the study's results to ``output``, and exit."""
    from epsmesh.plan.plan import make_plan

    (study,) = read_all([file])
    paths = _stores(study, stores, output)
    store_to_write(target, output)
    check_output(*result_files(output, study.name))
    plan = make_plan(study, without=check_names(without))
    sources, records, further = _merged(paths, target, plan)
    problems = [problem for source in sources for problem in source.problems]
    for problem in problems:
        error(problem)

    from epsmesh.report.publish import ResultsError, publish
    from epsmesh.run.outcome import count_states, failures

    counts, failed = count_states(plan, records), failures(plan, records)
    try:
        results = publish(plan, records, _dates(records), output)
    except ResultsError as wrong:
        fault, status = of_results(wrong, study.file)
        fail(fault, status=status)
    missing = frozenset(solve.key for solve in plan.solves if solve.key not in records)
    options = [word for name in without or () for word in ("--without", name)]
    again = _completing(plan, missing, paths, options)
    if further and not missing:  # not of any shard: earlier results decide it
        plan, missing = further, frozenset(solve.key for solve in further.solves)
        again = [" ".join(["epsmesh", "run", quote(study.file), *map(quote, options)])]
    totals = ", ".join(f"{count} {state}" for state, count in counts.items() if count)
    say(
        {
            "file": str(file),
            **counts,
            "shards": [{"file": str(s.path), "records": s.records, "taken": s.taken} for s in sources],
            "problems": problems,
            "failures": [{"case": case, "message": message} for case, message in failed],
            "again": again,
            "files": [str(path) for path in results.files],
            "unchanged": [str(path) for path in results.unchanged],
        },
        *(f"{source.path}: {counted(source.records, 'record')}, {source.taken} of them new" for source in sources),
        f"{file}: {totals}; {results}",
    )
    if not is_json_wanted():
        for case, message in failed:
            error(f"failed: {case}: {message}")
        _print_pending(plan, missing, again)
    raise typer.Exit(SOME_FAILED if problems or missing or any(counts.get(state) for state in FAILURES) else DONE)


def _stores(study: "Study", given: list[Path] | None, output: Path) -> list[Path]:
    """Return the stores to merge; exit if one is absent, or if there is none."""
    from epsmesh.plan.shard import stores_of

    absent = [path for path in given or () if not path.is_file()]
    if absent:
        fail(*(of_file(path, "there is no such store") for path in absent))
    found = given or stores_of(output, study)
    if not found:
        folder = output / "shards"
        made = f"run them first: `epsmesh run {quote(study.file)} --shard 1/4`, …"
        fail(of_file(folder, f"there are no shards of {study.file}; {made}", CLUSTER))
    return found


def _merged(paths: list[Path], path: Path, plan: "Plan") -> "tuple[tuple[Source, ...], dict[str, Record], Plan | None]":
    """Merge into the store at ``path``; return the records of the plan and of skipped cases, and the further plan."""
    from epsmesh.run import merge as merging
    from epsmesh.run.completion import complete
    from epsmesh.run.stop import skipped
    from epsmesh.run.store import Store, StoreError

    if path.resolve() in [source.resolve() for source in paths]:
        fail(of_file(path, "the shards are merged into this store, so it cannot be one of them"))
    with refusing(StoreError, file=path):
        store = Store(path)
        if store.notice:
            error(store.notice)
        sources = merging.merge(paths, store)
        records = store.get(plan.all_keys)
        further = complete(plan, records, store.get)
        store.close()
    return sources, records | skipped(plan, records), further


def _dates(records: dict[str, "Record"]) -> dict[str, str]:
    """Return when the first and the last record was made."""
    dates = sorted(str(date) for record in records.values() if (date := record.provenance.get("date")))
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return {"start": dates[0] if dates else now, "end": dates[-1] if dates else now}


def _completing(plan: "Plan", missing: frozenset[str], paths: list[Path], options: list[str]) -> list[str]:
    """Return the commands that compute the missing steps: runs of their shards, split as in the latest run."""
    if not missing:
        return []
    from epsmesh.plan.shard import deal, shard_of

    file = quote(plan.study.file)
    words = ["epsmesh", "run", file, *map(quote, options)]
    latest = max(paths, key=lambda path: path.stat().st_mtime if shard_of(path) else -1.0)
    shard = shard_of(latest)
    if shard is None:
        return [" ".join(words)]
    parts = deal(plan, shard.count)
    numbers = [number for number, part in enumerate(parts, start=1) if part & missing]
    commands = [" ".join([*words, "--shard", f"{number}/{shard.count}"]) for number in numbers]
    if not options:
        array = ",".join(map(str, numbers))
        commands.append(f"SHARDS={shard.count} sbatch --array={array} scripts/slurm/shards.sbatch {file}")
    return commands


def _print_pending(plan: "Plan", missing: frozenset[str], again: list[str]) -> None:
    """Print the cases that are not stored, and the commands that compute them."""
    if not missing:
        return
    labels = [solve.label for solve in plan.solves if solve.key in missing]
    for label in labels[:_MOST_CASES]:
        error(f"pending: {label}")
    if len(labels) > _MOST_CASES:
        error(f"pending: … and {len(labels) - _MOST_CASES} more")
    error("compute them, then merge again:")
    for command in again:
        error(f"  {command}")
