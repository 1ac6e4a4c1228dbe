"""Ten million unknowns on one rank, and what ``epsmesh plan`` says of them: ``python -m benchmarks.huge``.

A disc off the planes of symmetry of a box, full order, degree 2, with the error bar: displacement elements (ν = .3) and
mixed ones (.49), of a tenth of a million, one and ten million unknowns. Each case is a process of its own. Its time is
processor seconds, from the geometry to the error bar. Its memory is the peak of one process, libraries included.

Forecasts are those of a plan before the mesh exists. The times of a plan follow stored cases: a forecast knows those of
the smaller cases, the first one none. Ten million unknowns take 3 to 5 minutes, and up to 16 GB.
"""

from typing import Any

from benchmarks.processor import run
from benchmarks.scenes import BOX, DISC, graded, study
from benchmarks.tables import Table, options
from epsmesh.plan.cost import CostModel, Observation, StepEstimate, fit
from epsmesh.plan.plan import make_plan
from epsmesh.run.record import Record
from epsmesh.study.read import parse

# Poisson's ratio by element; element size (mm) by millions of unknowns. Meshes from 40,000 tetrahedra on are refined,
# from 200,000 on twice.
POISSON = {"displacement": 0.3, "mixed": 0.49}
SIZES = {"0.1": 2.6, "1": 0.985, "10": 0.443}
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


def main() -> None:
    """Measure, print and write."""
    parser = options(__doc__)
    parser.add_argument("--elements", nargs="+", choices=POISSON, default=list(POISSON))
    parser.add_argument("--sizes", nargs="+", choices=SIZES, default=list(SIZES), help="millions of unknowns")
    asked = parser.parse_args()
    table = Table(COLUMNS)
    for element in asked.elements:
        known: list[Observation] = []
        for size in asked.sizes:
            table.add(measure(element, size, known))
    table.write("huge", asked.output)


if __name__ == "__main__":
    main()
