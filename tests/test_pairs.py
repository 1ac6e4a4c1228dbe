"""A seeded sample of the pairs of features: what is taken runs, and what is refused says why."""

import random

import pytest

from epsmesh.study.capabilities.obstacles import OBSTACLES
from epsmesh.study.capabilities.refusals import REFUSALS
from tests.pairs import Result, name_of, pairs, run, write_bodies

_EVERY = {name_of(pair): pair for pair in pairs()}
# F_exact, time steps and large depths take seconds, and remeshing a surface one: `make pairs` runs those, too.
_SLOW = {"F_exact", "surface", "image", "border", "accuracy", "relaxing regions", "relaxing round scene", "2 mm deep"}
_QUICK = [name for name, pair in _EVERY.items() if not _SLOW & {feature.name for feature in pair}]
_SAMPLE = random.Random(32).sample(_QUICK, 40)
_BY_DAY = 8


# Features that make no other case of a study, or none of one with a tool that finds its contact anyway.
_SAME_CASE = {
    "history",
    "relaxation",
    "relaxing regions",
    "relaxing round scene",
    "relaxing under traction",
    "F_exact",
    "model 3d",
    "swept E",
    "unilateral",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("bodies")
    write_bodies(path)
    return path


# Refusals that no table of features can hold: keys that a shape does not have, and ranges of Poisson's ratio.
_OF_SCHEMA = (
    "has no layer",
    "has no region",
    "has no support",
    "is not computed where two jaws close",
    "of the second jaw",
    "does not press the body on [body.support]",
    "with a parallel one opposite, for two jaws",
    "a tool that is inserted",
    "excludes [probe.insertion]",
    "would touch the body",
    'must be "unilateral"',
    "elements of degree 1 lock",
    "must be 0.2 to 0.45",
    "is not computed over time",
    "is not computed along an insertion",
    "has no F_exact",
    "is too large for a tool that deforms",
    "is not computed in a body in which tissue lies loose",
)


def test_every_pair_is_taken_or_refused_with_the_reason_of_the_table(folder):
    found = [run(pair, folder, solved=False) for pair in _EVERY.values()]
    assert {result.outcome for result in found} == {"taken", "refused"}
    reasons = (*(refusal.reason for refusal in REFUSALS), *OBSTACLES["F_exact"].values(), *_OF_SCHEMA)
    for result in found:
        if result.outcome == "refused":
            assert any(reason in result.message for reason in reasons), (result.name, result.message)
    assert sum(result.outcome == "taken" for result in found) >= 582
    keys = {result.name: result.key for result in found if result.outcome == "taken"}
    for name, key in keys.items():
        alone = {feature.name for feature in _EVERY[name] if feature.name not in _SAME_CASE}
        is_another = key not in {keys.get(one) for one in alone}
        assert len(_EVERY[name]) == 1 or _SAME_CASE & {*name.split(" + ")} or is_another


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if number < _BY_DAY else pytest.mark.nightly) for number, name in enumerate(_SAMPLE)],
)
def test_what_is_taken_runs(name, folder):
    result: Result = run(_EVERY[name], folder)
    assert result.outcome in ("taken", "refused"), result.message
