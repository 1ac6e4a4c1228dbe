"""Physical sense of loads: whether they fit the body and the probe."""

from collections.abc import Sequence
from itertools import product
from math import dist, inf
from typing import cast

from epsmesh.shapes.body import Body
from epsmesh.shapes.frame import PlaceError
from epsmesh.shapes.friction import STICK
from epsmesh.shapes.from_file import NO_NAMES, FromFile
from epsmesh.shapes.part import FREE, Cap
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.regions import Embedded
from epsmesh.shapes.registry import TERMS
from epsmesh.shapes.section import Section, in_mm
from epsmesh.shapes.segmented import Segmented
from epsmesh.shapes.support import NONE, Faces, NamedFace
from epsmesh.study.axis import Axis
from epsmesh.study.loads import Load, Traction
from epsmesh.study.problems import Problems, nearest
from epsmesh.study.regions import tissues_of
from epsmesh.study.schema import Material

PRESSES_NOT = (
    "has a pressure within, which does not press the body on [body.support]: add gravity or a traction to [load], omit "
    "the pressure, or give body.fixed"
)
# Largest distance of a centre from the surface, in units of the cap's radius.
_FARTHEST_OFF = 0.5


def check_loads(sections: dict[str, tuple[Section, ...]], axes: tuple[Axis, ...], problems: Problems) -> None:
    """Check every load on every body, under every probe, and on every mesh."""
    loads = [load for load in cast(Sequence[Load], sections["load"]) if _makes_sense(load, problems)]
    acting = [load for load in loads if load.acts]
    bodies, probes = cast(Sequence[Body], sections["body"]), cast(Sequence[Probe], sections["probe"])
    materials = cast(Sequence[Material], sections["material"])
    for axis in axes:
        if axis.section == "load" and axis.piece and not axis.owner:
            problems.error(axis.path, None, "is swept: give its table a `name`")
    for body in bodies:
        with problems.about(body=body):
            _check_capsules(body, problems)
            _check_rest(body, problems)
            _check_loose(body, problems)
    problems.each(lambda body, _: _check_imaged(body, loads, problems), body=bodies)
    is_grasped = any(probe.jaw for probe in probes)
    for body, load in product(bodies, loads):
        is_held = body.resting is not None or is_grasped or any(term.HOLDS for term in load.terms)
        if body.fixed == NONE and not is_held:
            with problems.about(body=body):
                _nothing_holds(problems)
        if body.resting is not None and body.pressures and not (load.acts or load.terms):
            with problems.about(body=body):
                problems.error("body.region", None, PRESSES_NOT)
        for name in TERMS:
            for number, term in enumerate(getattr(load, name), start=1):
                with problems.about(body=body):
                    _check_place(body, term.on, f"load.{name}[{number}].on", problems)
    if not acting:
        return
    if any(any(load.gravity) for load in acting):
        problems.each(_check_densities, body=bodies, material=materials)
    for body, load in product(bodies, acting):
        for number, traction in enumerate(load.traction, start=1):
            with problems.about(body=body):
                _check_traction(body, probes, traction, f"load.traction[{number}].on", problems)


def _check_capsules(body: Body, problems: Problems) -> None:
    """Check where capsules are: that of the body on its outer surface, those of regions on all of theirs."""
    key = "body.capsule.on"
    if body.capsule and body.capsule.on in body.cavities:
        problems.error(key, body.capsule.on, "is a hollow region: give that region a `capsule` of its own")
    elif body.capsule:
        _check_place(body, body.capsule.on, key, problems)
    for place, piece in zip(body.places, body.regions, strict=True):
        if isinstance(piece, Embedded) and piece.capsule and "on" in piece.capsule.model_fields_set:
            where = "is for [body.capsule]: that of a region is on all of its surface. Omit it"
            problems.error(f"body.{place}.capsule.on", None, where)


def _check_rest(body: Body, problems: Problems) -> None:
    """Report a body that is fixed as well as it rests on a support that lets go, and one that this does not fit."""
    if body.resting is not None:
        body.resting.check(body.reach_below, problems)
    elif isinstance(body, Segmented) and body.fixed == NONE:
        problems.error("body.fixed", NONE, NO_NAMES)
    if body.resting is not None and body.fixed != NONE:
        held = 'must be "none" with [body.support]: the part that rests on it is not fixed, nor is another'
        problems.error("body.fixed", body.model_dump()["fixed"], held)


def _check_loose(body: Body, problems: Problems) -> None:
    """Report second loose tissue, what touches no other or has none, and friction of tissue that is bonded."""
    loose = body.loose
    for place, piece in zip(body.places, body.regions, strict=True):
        key = f"body.{place}"
        if loose is not None and isinstance(piece, Embedded) and piece.capsule and place != loose.place:
            beside = f"is not computed in a body in which tissue lies loose, {loose.name}: omit one of the two"
            problems.error(f"{key}.capsule", None, beside)
        if piece.contact == "bonded":
            if piece.friction:
                without = 'is of tissue with contact = "unilateral": what is bonded does not slide. Omit it'
                problems.error(f"{key}.friction", STICK if piece.friction == inf else piece.friction, without)
        elif loose is None:
            problems.error(f"{key}.contact", piece.contact, "must be bonded in the last layer: no tissue is below it")
        elif place != loose.place:
            what = f"is computed of one layer or region only, and {loose.name} has it"
            problems.error(f"{key}.contact", piece.contact, what)
        elif isinstance(piece, Embedded) and (piece.is_hollow or piece.capsule):
            has = (
                "is of tissue: omit `hollow`, or it" if piece.is_hollow else "is not computed below a capsule: omit one"
            )
            problems.error(f"{key}.contact", piece.contact, has)


def _check_imaged(body: Body, loads: Sequence[Load], problems: Problems) -> None:
    """Report a body that has its shape under loads of which the study has none."""
    is_all, what = body.is_loaded == "all", "gravity" if body.is_loaded == "gravity" else "load"
    if body.is_loaded == "none" or any(any(load.gravity) or (is_all and load.acts) for load in loads):
        return
    if not (is_all and body.pressures):
        problems.error("body.is_loaded", body.is_loaded, f"there is no {what} in [load]: add it, or omit is_loaded")


def _nothing_holds(problems: Problems) -> None:
    able = " or ".join(f"[[load.{name}]]" for name, kind in TERMS.items() if kind.HOLDS)
    more = f", or add {able}" if able else "; a term that would hold it instead is a file that you add"
    problems.error(
        "body.fixed",
        NONE,
        f"nothing holds the body: fix a face{more}, let it rest on [body.support], or close two jaws on it",
    )


def _check_traction(body: Body, probes: Sequence[Probe], traction: Traction, key: str, problems: Problems) -> None:
    if _check_place(body, traction.on, key, problems) and isinstance(cap := traction.on, Cap):
        problems.each(lambda probe, _: _check_beside(body, probe, cap, key, problems), probe=probes)


def _makes_sense(load: Load, problems: Problems) -> bool:
    sane = True
    for number, traction in enumerate(load.traction, start=1):
        if (traction.pressure is None) == (traction.traction is None):
            problems.error(
                f"load.traction[{number}]",
                None,
                "needs either `pressure` (against the outward normal) or `traction` (a vector)",
            )
            sane = False
    return sane


def _check_densities(body: Body, material: Material, problems: Problems) -> None:
    if not body.is_filled and material.density is None:
        problems.error("material.density", None, 'is required for gravity: density = "1060 kg/m^3"')
    if body.is_filled:
        for key, tissue in tissues_of(body, material):
            if tissue.density is None:
                problems.error(f"{key}.density", None, 'is required for gravity: density = "1060 kg/m^3"')


def _check_place(body: Body, on: str | Cap, key: str, problems: Problems) -> bool:
    """Report a part of the boundary that does not exist, and return whether it does."""
    names = sorted([*body.surfaces(), *body.cavities])
    if isinstance(on, Cap):
        found = [in_mm(c) for c in on.around]
        try:
            off = dist(body.frame(on.around).point, on.around)
        except PlaceError as error:
            problems.error(key, found, str(error))
            return False
        if off > _FARTHEST_OFF * on.radius:
            problems.error(
                key,
                found,
                f"is {in_mm(off)} off the surface of the body: must be at most half the radius of the cap, "
                f"{in_mm(_FARTHEST_OFF * on.radius)}",
            )
            return False
        return True
    if on != FREE and on not in body.cavities and isinstance(body, FromFile) and body.HAS_NAMES:
        problems.error(key, on, 'faces of a CAD file have no tractions by name: use a cap around a point, or "free"')
        return False
    if on != FREE and on not in names:
        problems.error(key, on, f"the {body.shape} has no such face; {nearest(on, [*names, FREE])}")
        return False
    support = body.hold
    held = support.names if isinstance(support, Faces) else (support.face,) if isinstance(support, NamedFace) else ()
    if on in held:
        rests = "is fixed: what" if body.resting is None else "rests on [body.support]: what"
        problems.error(key, on, f"{rests} is there acts on the support alone")
        return False
    return True


def _check_beside(body: Body, probe: Probe, cap: Cap, key: str, problems: Problems) -> None:
    """Report a cap that may reach under the probe."""
    try:
        gap = dist(probe.frame_on(body).point, cap.around) - cap.radius - probe.circumradius
    except PlaceError:
        return
    if gap < 0:
        problems.error(
            key,
            [in_mm(c) for c in cap.around],
            f"the cap overlaps the tool by {in_mm(-gap)}; the tool reaches {in_mm(probe.circumradius)} from its axis: "
            "move the cap, or make it smaller",
        )
