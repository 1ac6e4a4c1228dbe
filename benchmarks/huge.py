"""Ten million unknowns on one rank, and what ``epsmesh plan`` says of them: ``python -m benchmarks.huge``.

A disc off the planes of symmetry of a box, full order, degree 2, with the error bar: displacement elements (ν = .3) and
mixed ones (.49), of a tenth of a million, one and ten million unknowns. Each case is a process of its own. Its time is
processor seconds, from the geometry to the error bar. Its memory is the peak of one process, libraries included.

Forecasts are those of a plan before the mesh exists. The times of a plan follow stored cases: a forecast knows those of
the smaller cases, the first one none. A case that fails has a line instead, and the memory that a plan says it needs.

The second table has the parts of a multigrid cycle for a million unknowns, with coarser meshes as levels and without.
All takes some six minutes, and up to 12 GB.
"""

import json
from typing import Any

from benchmarks import products
from benchmarks.processor import ask, run
from benchmarks.scenes import BOX, DISC, graded, study
from benchmarks.tables import Table, markdown, options, write
from epsmesh.plan.cost import CostModel, Observation, StepEstimate, fit
from epsmesh.plan.plan import make_plan
from epsmesh.run.record import Record
from epsmesh.study.read import parse

# Poisson's ratio by element; element size (mm) by millions of unknowns. Meshes from 40,000 tetrahedra on are refined,
# from 200,000 on twice.
POISSON = {"displacement": 0.3, "mixed": 0.49}
SIZES = {"0.1": 2.6, "1": 0.985, "10": 0.443}
# Millions of unknowns of the case whose cycle is measured, with these levels below degree 1.
CYCLE, WAYS = "1", ("coarser meshes", "algebraic")
COLUMNS = {
    "element": "",
    "unknowns": ",d",
    "iterations": "d",
    "error bar": ".2%",
    "memory (GB)": ".2f",
    "forecast (GB)": ".2f",
    "time (s)": ".1f",
    "forecast (s)": ".1f",
    "mesh (s)": ".1f",
    "of the bar (s)": ".1f",
}


def scene(element: str, size: str) -> dict[str, Any]:
    """Return the study of one case."""
    mesh = graded(f"{SIZES[size]} mm", "8 mm", "0.2 mm", 0.5, degree=2)
    return study(BOX, POISSON[element], DISC | {"at": ["3 mm", "5 mm"]}, mesh)


def forecast(asked: dict[str, Any], model: CostModel) -> StepEstimate:
    """Return what a plan estimates of a study of one case."""
    (step,) = make_plan(parse(asked)).meshes
    return model.step(step)


def measure(element: str, size: str, known: list[Observation]) -> dict[str, Any]:
    """Return the row of one case, and add its times to those that are ``known``."""
    asked = scene(element, size)
    expected, found = forecast(asked, fit(known)), run(asked)
    record = Record.from_json(found["record"])
    observation = record.observation()
    assert observation is not None
    known.append(observation)
    return {
        "element": element,
        "unknowns": record.dofs,
        "iterations": record.iterations,
        "error bar": record.force_error,
        "memory (GB)": found["peak"] / 1e9,
        "forecast (GB)": expected.memory / 1e9,
        "time (s)": record.time_total + record.time_error,
        "forecast (s)": expected.seconds,
        "mesh (s)": record.time_mesh,
        "of the bar (s)": record.time_error,
    }


def parts(size: str) -> list[dict[str, Any]]:
    """Return the rows of the parts of a cycle, each way in a process of its own."""
    ways = [ask(["-m", "benchmarks.huge", "--cycle", size, *more]) for more in ([], ["--algebraic"])]
    names = dict.fromkeys(name for way in ways for name in way)
    return [{"part": name, **dict(zip(WAYS, (way.get(name, 0.0) for way in ways), strict=True))} for name in names]


def main() -> None:
    """Measure, print and write."""
    parser = options(__doc__)
    parser.add_argument("--cycle", choices=SIZES, help="the parts of a cycle alone, as JSON")
    parser.add_argument("--algebraic", action="store_true", help="without coarser meshes")
    parser.add_argument("--elements", nargs="+", choices=POISSON, default=list(POISSON))
    parser.add_argument("--sizes", nargs="+", choices=SIZES, default=list(SIZES), help="millions of unknowns")
    asked = parser.parse_args()
    if asked.cycle:
        case = parse(scene("displacement", asked.cycle)).case(())
        print(json.dumps(products.cycle(case, meshes=not asked.algebraic)))
        return
    table, failed = Table(COLUMNS), ""
    for element in asked.elements:
        known: list[Observation] = []
        for size in asked.sizes:
            try:
                table.add(measure(element, size, known))
            except RuntimeError as error:
                needed = forecast(scene(element, size), fit(known)).memory / 1e9
                failed += (
                    f"{element}, {size} million unknowns: {str(error).splitlines()[0]} (plan: {needed:.1f} GB)\n\n"
                )
                print(failed, flush=True)
    of_cycle = parts(CYCLE)
    columns = {"part": ""} | dict.fromkeys(WAYS, ".1f")
    text = f"{markdown(table.rows, COLUMNS)}\n{failed}Parts of a cycle, {CYCLE} million unknowns, ns for each:\n\n"
    write("huge", asked.output, {"rows": table.rows, "cycle": of_cycle}, text + markdown(of_cycle, columns))


if __name__ == "__main__":
    main()
