"""Random scenes solved twice: on a mesh of chance, and to the accuracy of the truth."""

from collections.abc import Iterator
from dataclasses import replace
from math import isfinite

import numpy as np
from mpi4py import MPI

from pipeline.plan.plan import make_plan
from pipeline.plan.recipe import half_width_of
from pipeline.run.execute import compute
from pipeline.run.record import Record
from pipeline.study.load import parse
from pipeline.study.problems import StudyError
from pipeline.verify.coverage.bars import Trial
from pipeline.verify.coverage.families import FAMILIES
from pipeline.verify.sections import Section

SEED, COUNT = 2026, 160
# A mesh is naive if its elements at the probe's edge are larger than this, in units of the half width of contact.
_NAIVE = 0.35


def trials(comm: MPI.Comm, count: int = COUNT, seed: int = SEED, family: str = "design") -> Iterator[Trial]:
    """Yield the trials of ``count`` random scenes of a family; the same seed gives the same ones; collective."""
    random = np.random.default_rng(seed)
    thrown = FAMILIES[family]
    done = 0
    while done < count:
        scene, mesh = thrown.throw(random)
        truth_mesh = {"accuracy": thrown.truth} | {
            k: mesh[k] for k in ("epsilon", "outside") if mesh["outside"] != "coarse"
        }
        try:
            case, truth = _solve(comm, scene, mesh, ("axisymmetric",)), _solve(comm, scene, truth_mesh)
        except StudyError:  # the dice made no sense: a footprint over the edge, a ratio that locks
            continue
        done += 1
        trial = _trial(scene, mesh, case, truth)
        yield trial
        if isfinite(case.energy_release):
            yield _of_release(trial, case, truth)


def _of_release(trial: Trial, case: Record, truth: Record) -> Trial:
    """Return the trial of the energy that a slit's front releases, of the scene of that of its force."""
    degree, element = trial.kind
    return replace(
        trial,
        name=f"energy release: {trial.name}",
        force=case.energy_release,
        bar=case.energy_release_error,
        truth=truth.energy_release,
        truth_bar=truth.energy_release_error,
        kind=(degree, f"{element}, released"),
    )


def _trial(scene: Section, mesh: Section, case: Record, truth: Record) -> Trial:
    message = "; ".join(r.message for r in (case, truth) if not isfinite(r.force))
    (declared,) = parse({**scene, "mesh": mesh}).cases()
    rim = declared.mesh.rim_size(declared.probe.half_width) / half_width_of(declared)
    return Trial(
        _name(scene, mesh),
        case.force,
        case.force_error,
        truth.force,
        truth.force_error,
        message,
        (declared.mesh.degree, declared.element),
        "naive" if rim > _NAIVE else "graded",
        refused=not case.is_ok and not message,
    )


def _solve(comm: MPI.Comm, scene: Section, mesh: Section, without: tuple[str, ...] = ()) -> Record:
    study = parse({**scene, "mesh": mesh, "solve": {"exact": False}})
    (record,) = compute(make_plan(study, without=without), comm).values()
    return record


def _name(scene: Section, mesh: Section) -> str:
    body, probe = scene["body"], scene["probe"]
    at = f" at {' '.join(probe['at'])}" if "at" in probe else ""
    along = f" along {probe['direction'][0]:.2f} {probe['direction'][1]:.2f}" if "direction" in probe else ""
    tool = f"{probe['shape']} {probe.get('length') or probe.get('axes', probe.get('radius'))}{along}{at}"
    if "incision" in probe:
        tool += f" in a slit of {probe['incision']}, ends {probe['ends']},"
    sizes = f"rim {mesh['rim']} growth {mesh['growth']} fine {mesh['fine']}" if "rim" in mesh else "truth"
    return (
        f"{body['shape']} {_size(body)} on its {body['fixed']}{_regions(body)}, {tool} {probe['contact']},"
        f" ν {scene['material']['poisson']:g},"
        f" degree {mesh.get('degree', '-')} {sizes} ε {mesh.get('epsilon', '-')} {mesh.get('outside', '')}"
    )


def _size(body: Section) -> str:
    """Write how large a body is."""
    if body["shape"] == "surface":
        return str(body["file"])
    if body["shape"] == "cylinder":
        return f"{body['radius']} × {body['height']}"
    return " × ".join(body["axes"] if body["shape"] == "ellipsoid" else body["size"])


def _regions(body: Section) -> str:
    """Write what a body is made of besides its material."""
    layers, inclusions = body.get("layers", ()), body.get("inclusion", ())
    sizes = [piece["thickness"] for piece in layers]
    sizes += [f"{p.get('radius') or ' × '.join(p['axes'])} at {' '.join(p['at'])}" for p in inclusions]
    return "".join(
        f", {piece['name']} {size} E {piece['young']} ν {piece['poisson']:g}"
        for piece, size in zip((*layers, *inclusions), sizes, strict=True)
    )
