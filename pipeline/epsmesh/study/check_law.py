"""Laws of large displacements: keys that they need, keys that none reads, and bounds that depend on the law."""

from collections.abc import Iterator, Sequence
from math import sqrt
from typing import Any

from epsmesh.shapes.body import Body
from epsmesh.shapes.probe import is_direction
from epsmesh.shapes.regions import Region
from epsmesh.shapes.section import words_of
from epsmesh.shapes.tissue import LAWS, MOST_TERMS, Term, Tissue
from epsmesh.study.problems import Problems
from epsmesh.study.regions import tissues_of
from epsmesh.study.schema import Material

_OF_LAWS = tuple(dict.fromkeys(key for keys in LAWS.values() for key in keys))
# Rounding of shares that add up to 1, and the least exponent.
_SAME, _LEAST_ALPHA = 1e-9, 0.1
_UNSTABLE = "the tissue would lose its stiffness at some strain"


def check_laws(bodies: Sequence[Body], materials: Sequence[Material], problems: Problems) -> None:
    """Check the laws of all regions of every body, and their parameters."""
    problems.each(_check_tissues, body=bodies, material=materials)
    _check_unread([({"material": one}, "material", one) for one in materials], problems)
    _check_unread([({"body": body}, key, one) for body in bodies for key, one in _regions(body)], problems)


def _regions(body: Body) -> Iterator[tuple[str, Tissue]]:
    unused = Material.model_construct(young=1.0, poisson=0.0)
    return ((key, tissue) for key, tissue in tissues_of(body, unused) if key != "material")


def _check_tissues(body: Body, material: Material, problems: Problems) -> None:
    """Check each region; all must be for large displacements, or none."""
    tissues = dict(tissues_of(body, material))
    main = body.main(material)
    model = next((tissue for tissue in tissues.values() if tissue.is_large), main) if body.is_filled else main
    for key, tissue in tissues.items():
        _check_tissue(key, tissue, problems)
        complete = body.completed(tissue, main) if isinstance(tissue, Region) else tissue
        if complete.law is None and model.is_large:
            problems.error(
                f"{key}.law",
                None,
                "is required: another tissue of the body has a law of large displacements, and where layers fill the "
                f"body, each has its own. For the same law, write {_law_in_words(model)}",
            )
        elif complete.is_large != model.is_large:
            problems.error(
                f"{key}.law",
                tissue.law or "linear",
                "must be linear in all regions, or in none: linear elasticity resists the rotations of large "
                "displacements",
            )
        elif key != "material" and complete.is_large and tissue.poisson < (least := Material.LEAST_OF_LARGE):
            problems.error(
                f"{key}.poisson", tissue.poisson, f"must be at least {least} with a law of large displacements"
            )


def _law_in_words(tissue: Tissue) -> str:
    keys = LAWS[str(tissue.law)]
    return f'law = "{tissue.law}"' + (f" and its own {' and '.join(keys)}" if keys else "")


def _check_tissue(key: str, tissue: Tissue, problems: Problems) -> None:
    """Report missing parameters, and values with which the law is unstable."""
    for name, value in tissue.given.items():
        if value is None:
            example = f"{name} = {words_of(Tissue, name).example}"
            problems.error(f"{key}.{name}", None, f'is required with law = "{tissue.law}": such as {example}')
            return
    c2, c3 = tissue.c2, tissue.given.get("c3", 0.0)
    if tissue.law == "mooney-rivlin" and c2 is not None and not 0 <= c2 <= 1:
        problems.error(f"{key}.c2", c2, f'must be 0 to 1 with law = "mooney-rivlin": elsewhere, {_UNSTABLE}')
    if tissue.law == "yeoh" and c2 is not None and c2 < -(least := sqrt(3 * c3)):
        problems.error(
            f"{key}.c2",
            c2,
            f'must be at least {-least:.4g}, which is −√(3 c3), with law = "yeoh": below, {_UNSTABLE}',
        )
    fibres = tissue.given.get("fibres")
    if fibres is not None and not is_direction(fibres.direction):
        found = list(fibres.direction)
        problems.error(f"{key}.fibres.direction", found, "must be a vector of three finite numbers, not all zero")
    if tissue.law == "ogden":
        _check_terms(key, tissue.terms, problems)


def _check_terms(key: str, terms: Sequence[Term], problems: Problems) -> None:
    """Report shares that do not add up to 1, and exponents near 0, where terms of the energy nearly cancel."""
    shares = [term.share for term in terms if term.share is not None]
    total, left = sum(shares), len(terms) - len(shares)
    if len(terms) > MOST_TERMS:
        problems.error(f"{key}.terms", None, f"has {len(terms)} terms: at most {MOST_TERMS}")
    elif left > 1 or (left == 1 and total >= 1 - _SAME):
        problems.error(f"{key}.terms", None, f"one term may omit its share, if the others leave some of 1: {total:.6g}")
    elif left == 0 and abs(total - 1) > _SAME:
        problems.error(f"{key}.terms", None, f"shares must add up to 1, which makes mu the shear modulus: {total:.6g}")
    for number, term in enumerate(terms, start=1):
        if abs(term.alpha) < _LEAST_ALPHA:
            allowed = f"must be at least {_LEAST_ALPHA}, or at most -{_LEAST_ALPHA}"
            problems.error(f"{key}.terms[{number}].alpha", term.alpha, allowed)


def _check_unread(given: Sequence[tuple[dict[str, Any], str, Tissue]], problems: Problems) -> None:
    """Report keys that are given and that no law of the sweep reads; ``given`` has tables, place and tissue."""
    read = {(key, next(iter(about.values())).name, name) for about, key, tissue in given for name in tissue.given}
    for about, key, tissue in given:
        owner = next(iter(about.values())).name
        for name in (name for name in _OF_LAWS if name in tissue.model_fields_set):
            if (key, owner, name) not in read:
                laws = " or ".join(f'"{law}"' for law, keys in LAWS.items() if name in keys)
                found = getattr(tissue, name)
                with problems.about(**about):
                    value = found if isinstance(found, str | float) else None  # no tables
                    problems.error(f"{key}.{name}", value, f"is read only with law = {laws}")
