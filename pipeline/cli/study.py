"""The commands that run studies and show what came of them."""

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline import __version__
from pipeline.cli.console import print_json
from pipeline.cli.faults import (
    BAD_INPUT,
    DONE,
    INTERRUPTED,
    SOME_FAILED,
    Fault,
    as_data,
    fail,
    of_results,
    of_study,
    tell,
)
from pipeline.cli.words import (
    DEFAULT_MESHES,
    DEFAULT_OUTPUT,
    File,
    Files,
    Json,
    Output,
    Quiet,
    StoreFile,
    Verbose,
    Without,
    axes_of,
    check_machine,
    check_names,
    check_output,
    check_shard,
    check_store,
    load_all,
    meant,
    stored_records,
    warn,
)
from pipeline.files import STORE_NAME, result_files
from pipeline.printable import counted

if TYPE_CHECKING:
    from pipeline.plan.plan import Plan
    from pipeline.run.progress import Terminal


def validate(files: Files, as_json: Json = False) -> None:
    """Check study files, and say everything that is wrong with them.

    Example: epsmesh validate studies/*.toml
    """
    from pipeline.plan.plan import make_plan
    from pipeline.study.load import load
    from pipeline.study.problems import StudyError

    failed = False
    report: list[dict[str, Any]] = []
    for file in files:
        try:
            study = load(file)
        except StudyError as wrong:
            failed = True
            faults = of_study(wrong, meant(file))
            report.append({"file": str(file), "errors": as_data(faults, BAD_INPUT)["errors"], "warnings": []})
            tell(faults)
            continue
        cases = len(make_plan(study).keys)
        report.append({"file": str(file), "errors": [], "warnings": list(study.warnings), "cases": cases})
        if not as_json:
            warn(study)
            print(f"{file}: fine; {counted(cases, 'case')}{axes_of(study)}")
    if as_json:
        print_json(report)
    raise typer.Exit(BAD_INPUT if failed else DONE)


def run(
    files: Files,
    output: Annotated[Path, typer.Option(metavar="DIR", help="Folder for <study>.nc and the figure.")] = DEFAULT_OUTPUT,
    store: StoreFile = None,
    meshes: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the meshes that are kept.")] = DEFAULT_MESHES,
    fresh: Annotated[bool, typer.Option("--fresh", help="Compute again what is stored.")] = False,
    without: Without = None,
    shard: Annotated[
        str | None,
        typer.Option(metavar="I/N", help="Do part I of N only, for `epsmesh merge`; kept in OUTPUT/shards."),
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
    as_json: Json = False,
    profile: Annotated[bool, typer.Option("--profile", help="Print where the time went (on the first rank).")] = False,
) -> None:
    """Run studies: forces, timings, dataset and figure. Under mpirun, on all ranks.

    Cases that are stored already are read back, so an interrupted run goes on where it was. With --json standard
    output holds one object, at the end; progress goes to standard error.

    With --shard I/N no dataset is written: N such runs, which need not know of each other, do the study, and
    `epsmesh merge` brings them together.

    Example: epsmesh run studies/figure3.toml

    Example: mpirun -n 4 epsmesh run studies/figure3.toml

    Example: epsmesh run studies/figure3.toml --shard 3/8
    """
    studies, left_out = load_all(files), check_names(without)
    if store:
        check_store(store)
    part = check_shard(shard, studies)
    # Where nothing was said, meshes that cannot be kept are made again: that stops nobody.
    check_output(store or output / STORE_NAME, folder=None if meshes == DEFAULT_MESHES else meshes)
    for study in () if part else studies:
        check_output(*result_files(output, study.name))
    check_machine()
    from pipeline import workflow
    from pipeline.cli.outcome import announce, conclude, print_stages
    from pipeline.cli.outcome import as_data as outcome_data
    from pipeline.run.store import StoreError
    from pipeline.solve import CompilerError

    comm, found = workflow.world(), list[dict[str, Any]]()
    speaks, failed = comm.rank == 0, False
    for study in studies:
        start = time.monotonic()
        try:
            main = output / STORE_NAME
            path = store or (part.store(output, study) if part else main)
            plan, opened = workflow.prepare(
                study,
                comm,
                path,
                fresh=fresh,
                without=left_out,
                meshes=meshes,
                shard=part,
                beside=main if part else None,
            )
            if speaks:
                announce(plan, opened, quiet=quiet or as_json, verbose=verbose)
                if as_json and not quiet:
                    warn(study)
            progress = _progress(plan, verbose=verbose) if speaks and not quiet else None
            with workflow.abort_on_exception(comm):
                outcome = workflow.run(plan, opened, comm, output, progress)
        except (StoreError, CompilerError) as wrong:
            fail(Fault(str(wrong), file=study.file), on_all_ranks=True)
        except workflow.ResultsError as wrong:
            fault, status = of_results(wrong, study.file)
            fail(fault, status=status, on_all_ranks=True)
        if speaks:
            seconds = time.monotonic() - start
            conclude(plan, opened, outcome, seconds, part, quiet=quiet or as_json)
            found.append(outcome_data(plan, opened, outcome, seconds))
        failed = failed or outcome.counts["failed"] > 0
        if outcome.interrupted:
            break
    ended = INTERRUPTED if outcome.interrupted else SOME_FAILED if failed else DONE
    if speaks and profile:
        print_stages(sys.stderr if as_json else sys.stdout)
    if speaks and as_json:
        print_json({"status": ended, "studies": found})
    if outcome.interrupted:
        workflow.end_ranks(comm, INTERRUPTED)
    raise typer.Exit(ended)


def status(
    file: File, output: Output = DEFAULT_OUTPUT, store: StoreFile = None, without: Without = None, as_json: Json = False
) -> None:
    """Say which cases are done, failed, skipped, or still to be run.

    A run without some of its reductions is asked after with the same --without.

    Example: epsmesh status studies/figure3.toml
    """
    from pipeline.plan.plan import make_plan
    from pipeline.run.outcome import count_states, failures
    from pipeline.run.stop import skipped

    (study,) = load_all([file])
    plan = make_plan(study, without=check_names(without))
    records, _ = stored_records(store or output / STORE_NAME, plan)
    records |= skipped(plan, records)
    counts, failed = count_states(plan, records), failures(plan, records)
    if as_json:
        print_json({"file": str(file), **counts, "failures": [{"case": c, "message": m} for c, m in failed]})
        return
    told = f"{counts['ok']} done, {counts['failed']} failed"
    told += "".join(f", {counts[state]} {state}" for state in ("skipped", "lost") if counts.get(state))
    print(f"{file}: {told}, {counts['pending']} pending{axes_of(study)}")
    for case, message in failed:
        print(f"  failed: {case}: {message}")


def version(as_json: Json = False) -> None:
    """Print the versions that a force depends on.

    Example: epsmesh version --json
    """
    from pipeline.run.provenance import provenance

    known = {"version_epsmesh": __version__, **provenance(ranks=1)}
    versions = {k.removeprefix("version_"): v for k, v in known.items() if k.startswith("version_")}
    if as_json:
        print_json(versions)
        return
    for name, value in versions.items():
        print(f"{name:10} {value}")


def _progress(plan: "Plan", *, verbose: bool) -> "Terminal":
    from pipeline.run.progress import Terminal
    from pipeline.run.remaining import Remaining, expectations

    return Terminal(len(plan.solves), Remaining(expectations(plan)), verbose=verbose)
