"""An export on several ranks: they share the work, and what they make of it is what one alone makes."""

from dataclasses import replace
from itertools import chain

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh_realtime.export import curved, far, tabulate
from epsmesh_realtime.export.curved import curved_model
from epsmesh_realtime.export.export import export
from epsmesh_realtime.export.kept import Kept
from epsmesh_realtime.export.ranks import ALONE, Ranks
from epsmesh_realtime.export.scope import scope_of
from tests.export.test_export import AS_USUAL, CYLINDER, DOME, SOFT, Known, study

pytestmark = pytest.mark.mpi
WORLD = Ranks(MPI.COMM_WORLD)
SHARES = ["together", "in_turn"]
several = pytest.mark.skipif(WORLD.comm.size == 1, reason="one rank agrees with itself")


def squares(share: str, count: int, ranks: Ranks = WORLD) -> tuple[list[int], list[int]]:
    """Return the squares of 0, 1, …, and those of which this rank was asked."""
    own: list[int] = []

    def square(number: int) -> int:
        own.append(number)
        if number == 5:
            raise ValueError("five")
        return number**2

    if share == "in_turn":
        return ranks.in_turn(range(count), square, "squares"), own
    return ranks.together(range(count), lambda some: [square(number) for number in some]), own


@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("count", [0, 1, 5])
def test_each_item_is_one_ranks_and_all_have_what_came_of_it(share, count):
    found, own = squares(share, count)
    assert found == [n**2 for n in range(count)]
    assert sorted(chain(*WORLD.comm.allgather(own))) == list(range(count))


@pytest.mark.parametrize("share", SHARES)
def test_what_fails_on_one_rank_is_raised_on_all(share):
    with pytest.raises((ValueError, RuntimeError), match="five") as raised:
        squares(share, 7)
    # Once as itself, where it was met.
    assert WORLD.comm.allreduce(raised.type is ValueError) == 1
    with pytest.raises(ValueError if WORLD.comm.rank == 0 else RuntimeError, match="first"):
        WORLD.on_first(lambda: int("first"))
    assert WORLD.on_first(lambda: WORLD.comm.rank) == 0


@several
def test_ranks_that_ask_for_different_work_are_told_so():
    with pytest.raises(RuntimeError, match="disagree on the number"):
        squares("together", 3 + WORLD.comm.rank)


class Stopped(Exception):
    """In place of a kill."""


@pytest.mark.parametrize("body", [CYLINDER, pytest.param(DOME, marks=pytest.mark.nightly)])
def test_an_export_that_was_killed_goes_on_from_there(monkeypatch, tmp_path, body):
    """Nothing is solved twice, and the model is right; the files are removed when it is done.

    It is killed twice: while its table is solved, and while its surface is.
    """
    if WORLD.comm.size > 1:
        pytest.skip("of one rank")
    few = {
        tabulate: {"_SIZES": (2, 4), "_POISSONS": 1},
        curved: {"SIZES_CURVED": (1, 2)},
        far: {"_SIZE": 2, "_HELD_OUT": 1},
    }
    for module, name, value in ((module, *one) for module, names in few.items() for one in names.items()):
        monkeypatch.setattr(module, name, value)
    scope = replace(scope_of(study(body=body)), sections={"body": body, "material": SOFT}, poissons=(0.45, 0.45))
    put, kept = Kept.put, list[object]()

    def made(most: int, of: str = ""):
        def counted(self, work, array):
            put(self, work, array)
            kept.append(repr(work))
            if sum(of in work for work in kept) >= most:
                raise Stopped

        monkeypatch.setattr(Kept, "put", counted)
        keepers.append(Kept(tmp_path / "m.epsm", scope))
        ranks = Ranks(MPI.COMM_SELF, told.append, keepers[-1])
        return export(scope, 0.1, 4, margin=0.5, ranks=ranks)

    told, keepers = list[str](), list[Kept]()
    with pytest.raises(Stopped):
        made(5)
    (part,) = tmp_path.iterdir()
    with part.open("ab") as file:
        file.write(b'{"key": "torn')
    with pytest.raises(Stopped):
        made(2, "surface")
    before = len(kept)
    again = made(1000)
    assert before < len(kept) == len({*kept}) > 9
    assert all("surface" in work for work in kept[before:])
    assert any("the export needs about" in line and " solves, " in line for line in told)
    assert any("left" in line for line in told)
    assert max(abs(check.error) for check in again.judged) < 0.02
    for one in keepers:
        one.remove()
    assert not [*tmp_path.iterdir()]


@several
def test_ranks_make_the_model_that_one_makes(monkeypatch):
    for module, name, value in ((far, "_SIZE", 2), (far, "_HELD_OUT", 1), (tabulate, "_POISSONS", 2)):
        monkeypatch.setattr(module, name, value)
    scope = replace(scope_of(study()), sections={"body": CYLINDER, "material": SOFT})
    found, alone = (export(scope, 0.1, 4, margin=0.5, surface=True, ranks=ranks) for ranks in (WORLD, ALONE))
    assert found.places == alone.places
    assert found.model.bar == pytest.approx(alone.model.bar, rel=1e-6)
    for name in ("reciprocal", "curvature", "tensors"):
        numbers, known = (getattr(made.model.table, name) for made in (found, alone))
        assert np.abs(numbers - known).max() <= 1e-8 * np.abs(known).max()
    for one, other in zip(found.fitted + found.judged, alone.fitted + alone.judged, strict=True):
        assert (one.x, one.y, one.tool, one.full) == (other.x, other.y, other.tool, pytest.approx(other.full, rel=1e-8))
    # Modes are left out up to a share of the largest value, and a round body has pairs of alike ones: rounding decides.
    reach = found.model.table.reach[0]
    places = [(0.3 * reach, 0.0), (-0.5 * reach, 0.4 * reach), (0.1 * reach, -0.8 * reach)]
    numbers, known = (made.model.pairs.regular(places, places, 0.4) for made in (found, alone))
    assert np.abs(numbers - known).max() <= 2e-3 * np.abs(known).max()
    seen, known = (made.surface.far(*places[0], 0.4) for made in (found, alone))
    assert np.abs(seen - known).max() <= 0.03 * np.abs(known).max()


@several
def test_discs_on_a_curved_body_are_shared_out():
    scope = scope_of(study(body=DOME))
    (found, *counts), (alone, *known) = (curved_model(scope, Known(10e3), *AS_USUAL, ranks) for ranks in (WORLD, ALONE))
    assert counts == known
    assert np.array_equal(found.table.reciprocal, alone.table.reciprocal)
    assert np.array_equal(found.table.curvature, alone.table.curvature)
