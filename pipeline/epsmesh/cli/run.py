"""The command that runs studies: it prints the work to do, progress, and the result."""

import sys
import time
from collections import Counter
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from shlex import quote
from textwrap import shorten
from typing import TYPE_CHECKING, Annotated, Any, TextIO, cast

import typer

from epsmesh.alone import Jobs
from epsmesh.cli.console import error, print_json, warning
from epsmesh.cli.faults import DONE, INTERRUPTED, SOME_FAILED, Fault, fail, of_file, of_option, of_results, of_study
from epsmesh.cli.plan import Work, show_plans
from epsmesh.cli.words import (
    DEFAULT_MESHES,
    DEFAULT_OUTPUT,
    Files,
    Json,
    Output,
    Quiet,
    StoreFile,
    Verbose,
    Without,
    axes_of,
    check_kind,
    check_machine,
    check_names,
    check_output,
    check_shard,
    read_all,
    store_to_write,
    warn,
)
from epsmesh.files import STORE_NAME, result_files
from epsmesh.launcher import is_launched
from epsmesh.printable import counted
from epsmesh.states import FAILED, FAILURES, PENDING, SKIPPED

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from mpi4py import MPI

    from epsmesh.extensions import Made
    from epsmesh.plan.plan import Plan
    from epsmesh.plan.shard import Shard
    from epsmesh.run.progress import Terminal
    from epsmesh.study.sweep import Study
    from epsmesh.workflow import Opened, Outcome

# So many failed cases are listed; `status` lists all.
_MOST_FAILURES = 20
# So many lines tell of insertions.
_MOST_LINES = 40
# The line of a study has so many reasons, of so many letters each.
_MOST_REASONS, _LONGEST_REASON = 2, 120


def run(
    files: Files,
    output: Output = DEFAULT_OUTPUT,
    store: StoreFile = None,
    meshes: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the mesh cache.")] = DEFAULT_MESHES,
    jobs: Annotated[
        int, typer.Option("--jobs", "-j", metavar="N", help="Compute in N processes side by side.", min=1)
    ] = 1,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", "-n", help="Compute nothing: say what would be done, as `epsmesh plan` does.")
    ] = False,
    fresh: Annotated[bool, typer.Option("--fresh", help="Compute stored cases again.")] = False,
    without: Without = None,
    shard: Annotated[
        str | None, typer.Option(metavar="I/N", help="Run part I of N only, into a store of its own in DIR/shards.")
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
    as_json: Json = False,
    profile: Annotated[bool, typer.Option("--profile", help="Print the time of each stage on the first rank.")] = False,
) -> None:
    """Run studies: compute forces, write datasets and figures.

    Stored cases are read, not computed again: run the same command to continue after an interruption. With --json
    standard output gets one object at the end, and progress goes to standard error.

    -j N computes small cases side by side, without mpirun, with the same results; as many at once as memory allows. If
    one of the processes ends, the others go on. `mpirun -n N` also divides large cases.

    --shard I/N splits a study into N independent runs. A shard writes no dataset: afterwards, a run without --shard
    merges the shards, computes missing cases, and writes it. If a case has two records, the one with a force is kept,
    else the later one. Shards stay unchanged.

    Example: epsmesh run studies/figure3.toml

    Example: epsmesh run studies/figure3.toml -j 4

    Example: mpirun -n 4 epsmesh run studies/figure3.toml

    Example: epsmesh run studies/figure3.toml --shard 3/8
    """
    studies = read_all(files)
    part = check_shard(shard, studies)
    of = Work(output, store, check_names(without), jobs, part, fresh)
    _check_jobs(jobs, studies)
    if dry_run:
        show_plans(studies, of, quiet=quiet, verbose=verbose)
    # If the default mesh cache cannot be written, meshes are not cached, and the run continues.
    store_to_write(store, output)
    check_output(folder=None if meshes == DEFAULT_MESHES else meshes)
    for study in () if part else studies:
        check_output(*result_files(output, study.name))
    _check_left_out(studies, output)
    further = [] if part else [*_further(studies, output)]
    check_machine()
    from epsmesh import workflow

    comm = cast("MPI.Comm", Jobs(jobs)) if jobs > 1 else workflow.world()
    found, ended = list[dict[str, Any]](), DONE
    for study in studies:
        ended = max(ended, _run(study, comm, of, meshes, found, _Voice(quiet, verbose, as_json)))
        if ended == INTERRUPTED:
            break
    for number, make in further if ended != INTERRUPTED else ():
        made = make(store or output / STORE_NAME)
        if comm.rank == 0:
            found[number]["further"].append(made.data)
            for line in () if as_json else made.lines[-1:] if quiet else made.lines:
                print(line, flush=True)
    if comm.rank == 0 and profile:
        _print_stages(sys.stderr if as_json else sys.stdout)
    if comm.rank == 0 and as_json:
        print_json({"status": ended, "studies": found})
    if ended == INTERRUPTED:
        workflow.end_ranks(comm, INTERRUPTED)
    raise typer.Exit(ended)


@dataclass(frozen=True)
class _Voice:
    """How much a run prints."""

    quiet: bool
    verbose: bool
    as_json: bool


def _run(
    study: "Study",
    comm: "MPI.Comm",
    of: Work,
    meshes: Path,
    found: list[dict[str, Any]],
    voice: _Voice,
) -> int:
    """Run one study, print its result, and add it to what was ``found``; return the exit status. Collective."""
    from epsmesh import workflow
    from epsmesh.errors import CompilerError
    from epsmesh.run.jobs import WorkerError
    from epsmesh.run.store import StoreError

    start, speaks = time.monotonic(), comm.rank == 0
    store, beside = of.stores(study)
    try:
        plan, opened = workflow.prepare(
            study,
            comm,
            store,
            fresh=of.fresh,
            without=of.without,
            meshes=meshes,
            shard=of.shard,
            beside=beside,
        )
        if speaks:
            _announce(plan, opened, quiet=voice.quiet or voice.as_json, verbose=voice.verbose)
            if voice.as_json and not voice.quiet:
                warn(study)
        is_shown = speaks and not voice.quiet
        show = partial(_progress, plan, is_shown=not voice.as_json, verbose=voice.verbose) if is_shown else None
        with workflow.abort_on_exception(comm):
            outcome = workflow.run(plan, opened, comm, of.output, show)
    except (StoreError, CompilerError, WorkerError) as wrong:
        fail(Fault(str(wrong), file=study.file), on_all_ranks=True)
    except workflow.ResultsError as wrong:
        fault, status = of_results(wrong, study.file)
        fail(fault, status=status, on_all_ranks=True)
    if speaks:
        seconds = time.monotonic() - start
        _conclude(plan, opened, outcome, seconds, of.shard, quiet=voice.as_json)
        found.append(_as_data(plan, opened, outcome, seconds))
    if outcome.interrupted:
        return INTERRUPTED
    return SOME_FAILED if any(outcome.counts.get(state) for state in FAILURES) else DONE


def _check_jobs(jobs: int, studies: "list[Study]") -> None:
    """Exit if ranks have been started besides, or if a study times its cases."""
    if jobs > 1 and is_launched():
        fail(of_option("--jobs", jobs, "is for a run in one process, and a launcher has started this one: omit it"))
    if jobs > 1 and (timed := [study for study in studies if study.solve.timing]):
        why = "solve.timing = true compares times, which others would change: run it without --jobs"
        fail(*(of_file(study.file, why) for study in timed))


def _check_left_out(studies: "list[Study]", output: Path) -> None:
    """Say what a run leaves out of sections of other packages; exit if it would replace results of another kind."""
    from epsmesh.study.schema import added_to

    for study in studies:
        for left_out in filter(None, (one.left_out(study) for one in added_to(study.raw))):
            check_kind(output / f"{study.name}.nc")
            warning(f"{study.file}: {left_out}")


def _further(studies: "list[Study]", output: Path) -> "Iterator[tuple[int, Callable[[Path], Made]]]":
    """Yield what is made of studies when their cases are computed, with their numbers; exit if it cannot be."""
    from epsmesh.study.problems import StudyError
    from epsmesh.study.schema import added_to

    try:
        for number, study in enumerate(studies):
            yield from ((number, make) for one in added_to(study.raw) if (make := one.further(study, output)))
    except StudyError as wrong:
        fail(*of_study(wrong))


def _progress(first: "Plan", plan: "Plan", *, is_shown: bool, verbose: bool) -> "Terminal":
    """Return the progress of a ``plan``; of one that follows the ``first``, what there is to do ``is_shown``."""
    if plan is not first and is_shown:
        print(f"  to do besides: {_to_do(plan)}", flush=True)
    from epsmesh.run.progress import Terminal
    from epsmesh.run.remaining import Remaining, expectations

    return Terminal(len(plan.solves), Remaining(expectations(plan)), verbose=verbose)


def _announce(plan: "Plan", opened: "Opened", *, quiet: bool, verbose: bool) -> None:
    """Print, before the run, the work to do, and what is skipped and why."""
    for notice in opened.notices:
        error(notice)
    if quiet:
        return
    study = plan.study
    warn(study)
    print(f"{study.title}: {counted(len(plan.study), 'case')}{axes_of(study)}")
    for skipped in plan.skipped:
        print(f"  {skipped.name:13} {skipped.count:6}  {skipped.reason}")
    if study.solve.timing:
        print(f"  timing study: each case is computed alone {study.solve.repeats} times (median); nothing is skipped")
    if plan.solves:
        print(f"  to do: {_to_do(plan)}", flush=True)
        for number, step in enumerate(plan.meshes if verbose else (), start=1):
            print(f"    step {number}: {counted(len(step.solves), 'solve')}: {step.solves[0].label}", flush=True)


def _to_do(plan: "Plan") -> str:
    exact = sum(solve.is_reference for solve in plan.solves)
    of_exact = f" ({exact} of them for F_exact)" if exact else ""
    return f"{counted(len(plan.meshes), 'mesh')}, {counted(len(plan.solves), 'solve')}{of_exact}"


def _as_data(plan: "Plan", opened: "Opened", outcome: "Outcome", seconds: float) -> dict[str, Any]:
    """Return the result of a run as plain data."""
    return {
        "study": plan.study.file,
        "warnings": list(plan.study.warnings),
        "cases": len(plan.study),
        **outcome.counts,
        "stored": _read_back(plan),
        "failures": [{"case": case, "message": message} for case, message in outcome.failures],
        "skipped_because": list(_reasons(plan, opened, SKIPPED)),
        "files": [str(file) for file in outcome.results.files],
        "unchanged": [str(file) for file in outcome.results.unchanged],
        "seconds": round(seconds, 3),
        "interrupted": outcome.interrupted,
        "further": [],
    }


def _conclude(
    plan: "Plan", opened: "Opened", outcome: "Outcome", seconds: float, shard: "Shard | None", *, quiet: bool
) -> None:
    """Print, after the run, failures, counts and files."""
    for case, message in outcome.failures[:_MOST_FAILURES]:
        error(f"failed: {case}: {message}")
    file = quote(plan.study.file)
    if len(outcome.failures) > _MOST_FAILURES:
        error(f"… and {len(outcome.failures) - _MOST_FAILURES} more: `epsmesh status {file}` lists them")
    if not quiet:
        print(_line(plan, opened, outcome, seconds, shard), flush=True)
        for line in islice(_of_insertions(plan, outcome), _MOST_LINES):
            print(f"  {line}")
    if outcome.interrupted:
        cases = sum(outcome.counts.values())
        done = cases - outcome.counts[PENDING]
        again = f"`epsmesh run {file}{f' --shard {shard}' if shard else ''}` continues"
        error(f"interrupted: {done} of {cases} cases are stored; {again}")


def _of_insertions(plan: "Plan", outcome: "Outcome") -> "Iterator[str]":
    """Yield a line on each of the paths of insertions, as the dataset has them."""
    if plan.study.is_insertion and outcome.results.files:
        from epsmesh.report.insertion import answer
        from epsmesh.report.read import read_file

        yield from answer(read_file(outcome.results.files[0]))


def _line(plan: "Plan", opened: "Opened", outcome: "Outcome", seconds: float, shard: "Shard | None") -> str:
    """Return one line: cases by state, with reasons; files; time."""
    from epsmesh.run.remaining import format_seconds

    counts = []
    for state, count in outcome.counts.items():
        if not count and state != FAILED:
            continue
        reasons = _reasons(plan, opened, state)
        most = [text for text, _ in reasons.most_common(_MOST_REASONS)]
        if len(most) > 1:  # what one message says to do is at its end
            most = [shorten(text, _LONGEST_REASON, placeholder=" …") for text in most]
        why = "; ".join(dict.fromkeys(filter(None, most)))
        more = "; …" if len(reasons) > _MOST_REASONS else ""
        counts.append(f"{count} {state}{f' ({why}{more})' if why and state in (*FAILURES, SKIPPED) else ''}")
    stored = _read_back(plan)
    read_back = f" ({stored} from the store)" if stored else ""
    found, name = ", ".join(counts), plan.study.file
    if shard:
        # A shard may have F_exact but no case; if there are fewer steps than shards, it may have nothing.
        found = found if sum(outcome.counts.values()) else "F_exact" if plan.part else "nothing to do"
        name = f"{name}, shard {shard}"
        where = f"when all shards are done, merge them: `epsmesh run {quote(plan.study.file)}` with the same --output"
    else:
        where = str(outcome.results)
    return f"{name}: {found}{read_back}; {where}; {format_seconds(seconds)}"


def _print_stages(stream: TextIO) -> None:
    """Print the time that this process spent in each stage."""
    from epsmesh.stages import table

    for name, spent, share in table():
        print(f"{spent:10.2f} s  {100 * share:5.1f} %  {name}", file=stream)


def _read_back(plan: "Plan") -> int:
    """Return the number of cases all of whose records are stored."""
    return sum(plan.stored.issuperset(keys) for keys in plan.study.by_case(plan.keys))


def _reasons(plan: "Plan", opened: "Opened", status: str) -> Counter[str]:
    """Count the messages of the cases with a status."""
    found = (opened.records[key] for key in plan.keys if key in opened.records)
    return Counter(record.message for record in found if record.status == status)
