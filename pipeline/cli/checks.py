"""The commands that put the program itself to the test: verify, stress and benchmark."""

from collections.abc import Iterable
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline.cli.console import load_solvers, print_json
from pipeline.cli.faults import DONE, SOME_FAILED, Fault, fail, of_option
from pipeline.cli.words import DEFAULT_OUTPUT, Json, Output, check_output

if TYPE_CHECKING:
    from pipeline.verify.coverage import Trial
    from pipeline.verify.row import Row

Quick = Annotated[bool, typer.Option("--quick", help="A few rows of each kind.")]


def verify(
    coverage: Annotated[bool, typer.Option("--coverage", help="Random scenes: do the error bars hold?")] = False,
    count: Annotated[int, typer.Option(metavar="N", help="Number of random scenes.", min=1)] = 160,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of the random scenes.")] = 2026,
    family: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Random scenes: design (any body and tool), proportions (cylinders), ellipses, regions (layers, "
            "inclusions), organs, or tumours in them; of contact that is found: tools (on cylinders), contact (on "
            "ellipsoids and layers, off the axis), wedges; slits (blades that stand in them).",
        ),
    ] = "design",
    quick: Quick = False,
    as_json: Json = False,
) -> None:
    """Compare forces with closed forms and published tables.

    Manufactured solutions too, and the program's other paths. Exit status 1 if any row is out.

    Example: epsmesh verify

    Example: epsmesh verify --coverage

    Example: epsmesh verify --coverage --family proportions --count 400 --seed 7
    """
    from pipeline.workflow import ended_soon, world

    comm = world()
    speaks = comm.rank == 0
    if coverage:
        from pipeline.verify.coverage import FAMILIES, Coverage, trials

        if family not in FAMILIES:
            fail(of_option("--family", family, f"there is no such family of scenes; there are {', '.join(FAMILIES)}"))
        load_solvers()
        with ended_soon():
            told = tuple(_told(trials(comm, count, seed, family), _trial, speaks and not as_json))
        found = Coverage(told, FAMILIES[family].idle)
        right = found.is_met
        if speaks and as_json:
            groups = [
                {
                    "name": g.name, "cases": len(g.trials), "served": len(g.served), "held": g.held,
                    "median_bar_over_error": g.ratio, "worst": g.worst,
                }
                for g in found.groups
            ]  # fmt: skip
            print_json({"met": right, "groups": groups, "trials": [asdict(trial) for trial in found.trials]})
        elif speaks:
            print(found)
    else:
        from pipeline.verify import rows

        load_solvers()
        if speaks and not as_json:
            print(_ROW.format("", "scene", "path", "reference", "value", "error", "bar", "source"))
        with ended_soon():
            table = list(_told(rows(comm, quick=quick), _row, speaks and not as_json))
        right = all(row.is_right for row in table)
        if speaks and as_json:
            print_json([{**asdict(r), "error": r.error, "right": r.is_right} for r in table])
        elif speaks:
            out = sum(not row.is_right for row in table)
            print(f"{len(table)} rows, {out} out" if out else f"{len(table)} rows, all right")
    raise typer.Exit(0 if right else 1)


def benchmark(
    output: Output = DEFAULT_OUTPUT,
    repeats: Annotated[int, typer.Option(metavar="N", help="Runs of each point; the median counts.", min=1)] = 3,
    quick: Quick = False,
    as_json: Json = False,
) -> None:
    """Measure the error of F against run time and unknowns.

    For every kind of element and mesh. Writes work_precision.nc and its figure. Wants an idle machine, and takes ten
    minutes.

    Example: epsmesh benchmark
    """
    from pipeline.verify.work_precision import main, outputs
    from pipeline.workflow import ended_soon

    check_output(*outputs(output))
    load_solvers()
    with ended_soon():
        files = main(output, repeats, quick=quick)
    if as_json:
        print_json({"files": [str(path) for path in files]})
        return
    for path in files:
        print(path)


def stress(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="ROW...",
            help="Rows to run: each takes all rows whose name holds the word [default: all].",
            show_default=False,
        ),
    ] = None,
    quick: Quick = False,
    as_json: Json = False,
) -> None:
    """Put extremes of every input to the program.

    Results are held against references and invariances. Exit status 1 if any cell fails: that is, returns a wrong
    number with a good status.

    Example: epsmesh stress

    Example: epsmesh stress poisson layer
    """
    from pipeline.verify.stress import line, run, summary
    from pipeline.verify.stress.report import heading
    from pipeline.workflow import ended_soon, world

    load_solvers()
    comm = world()
    speaks = comm.rank == 0
    if speaks and not as_json:
        print(heading())
    try:
        with ended_soon():
            results = list(_told(run(comm, names, quick=quick), line, speaks and not as_json))
    except ValueError as wrong:
        fail(Fault(str(wrong), key="ROW", value=names))
    if speaks and as_json:
        print_json([asdict(result) for result in results])
    elif speaks:
        print(summary(results))
    raise typer.Exit(DONE if all(result.is_good for result in results) else SOME_FAILED)


_ROW = "{:4} {:58} {:24} {:>12} {:>12} {:>9} {:>9}  {}"


def _row(row: "Row") -> str:
    bar = row.bar + row.reference_bar
    error, bar_text = (f"{100 * row.error:+.4f} %", f"{100 * bar:.4f} %") if row.reference else (f"{row.error:.0e}", "")
    verdict = "ok" if row.is_right else "OUT"
    source = f"{row.source}; {row.message}" if row.message else row.source
    return _ROW.format(
        verdict, row.scene, row.path, f"{row.reference:.6g}", f"{row.value:.6g}", error, bar_text, source
    )  # fmt: skip


def _trial(trial: "Trial") -> str:
    verdict = "refused" if trial.refused else "ok" if trial.is_held else "OUT"
    return f"{verdict:7} error {100 * trial.error:8.4f} %  bar {100 * trial.bar:8.4f} %  {trial.name} {trial.message}"


def _told(items: Iterable[Any], words: Any, speaks: bool) -> Iterable[Any]:
    """Yield ``items``, each with its line printed as soon as it exists."""
    for item in items:
        if speaks:
            print(words(item), flush=True)
        yield item
