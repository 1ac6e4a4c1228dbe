"""60 s at 1 kHz of a co-simulation unit in FMPy: time, and the largest difference to the evaluator's forces.

    epsmesh export studies/mine.toml -o pad.epsm --fmu pad.fmu
    python -m benchmarks.fmu pad.epsm pad.fmu

It needs FMPy (`pip install epsmesh[fmi]`). The tool is a ball on a random smooth path, in and out of contact.
"""

import argparse
from pathlib import Path
from time import perf_counter

import numpy as np
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

import epsmesh

_STEP, _SECONDS = 1e-3, 60.0
# Of the way to the nearest side or to the bottom: the ball's radius, and its largest depth.
_RADIUS, _DEPTH = 0.25, 0.03
_HARMONICS = 12


def main() -> None:
    """Print one line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model", type=Path)
    parser.add_argument("unit", type=Path)
    asked = parser.parse_args()
    model = epsmesh.realtime.read(asked.model)
    problems = validate_fmu(str(asked.unit))
    room = min(*model.sides, model.thickness)
    time = _STEP * np.arange(round(_SECONDS / _STEP))
    rng, rates = np.random.default_rng(5), 2 * np.pi * np.arange(1, _HARMONICS + 1) / 10
    sums = [
        np.sin(np.outer(time, rates) + rng.uniform(0, 7, _HARMONICS)) @ rng.standard_normal(_HARMONICS)
        for _ in range(3)
    ]
    x, y, depth = (
        path / np.abs(path).max() * size for path, size in zip(sums, (*model.table.reach, _DEPTH * room), strict=True)
    )
    x, y = 0.7 * x, 0.7 * y
    spots = [model.spot(*place) for place in zip(x.tolist(), y.tolist(), strict=True)]
    local = np.array([(a, b, s.height) for a, b, s in zip(x, y, spots, strict=True)])
    normals = np.array([s.normal for s in spots])
    tips = model.origin + (local - depth[:, None] * normals) @ model.axes
    names = ["time", *(f"tip.{c}" for c in "xyz")]
    inputs = np.zeros(len(time), [(name, float) for name in names])
    for name, column in zip(names, (time, *tips.T), strict=True):
        inputs[name] = column
    begun = perf_counter()
    found = simulate_fmu(
        str(asked.unit), stop_time=_SECONDS, step_size=_STEP, output_interval=_STEP, input=inputs, validate=False,
        start_values={"shape": 1, "radius": _RADIUS * room},
    )  # fmt: skip
    took = perf_counter() - begun
    worst, answers = 0.0, 0
    for place, deep, row in zip(local @ model.axes + model.origin, depth, found[1:], strict=True):
        touch = model.query("sphere", radius=_RADIUS * room, at=place, depth=float(deep))
        if int(row["status"]) == 0 and touch.status == "ok":
            answers += 1
            force = np.array([row[f"force.{c}"] for c in "xyz"])
            worst = max(worst, float(np.linalg.norm(force - touch.force) / np.linalg.norm(touch.force)))
    print(
        f"{asked.unit}: {len(problems)} problems; {len(time)} steps in {took:.1f} s, with FMPy "
        f"{1e6 * took / len(time):.0f} µs a step; {answers} with contact; "
        f"largest difference to the evaluator {worst:.1e} of the force"
    )


if __name__ == "__main__":
    main()
