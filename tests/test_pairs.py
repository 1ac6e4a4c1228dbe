"""A seeded sample of the pairs of features: what is taken runs, and what is refused says why."""

import random

import pytest

from tests.pairs import Result, name_of, pairs, run, write_bodies

_EVERY = {name_of(pair): pair for pair in pairs()}
# F_exact takes seconds, and remeshing a surface one: `make pairs` runs those, too.
_SLOW = {"F_exact", "surface", "image", "accuracy"}
_QUICK = [name for name, pair in _EVERY.items() if not _SLOW & {feature.name for feature in pair}]
_SAMPLE = random.Random(32).sample(_QUICK, 60)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("bodies")
    write_bodies(path)
    return path


def test_every_pair_is_taken_or_refused_with_a_reason(folder):
    found = [run(pair, folder, solved=False) for pair in _EVERY.values()]
    assert not [result for result in found if result.outcome == "traceback"]
    assert all(result.message for result in found if result.outcome == "refused")


@pytest.mark.parametrize("name", _SAMPLE)
def test_what_is_taken_runs(name, folder):
    result: Result = run(_EVERY[name], folder)
    assert result.outcome in ("taken", "refused"), result.message
