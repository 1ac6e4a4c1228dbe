"""Matrices of a test of which a seeded sample runs by day: the whole of them runs by night."""

import random
from collections.abc import Iterable
from typing import Any

import pytest


def sampled(names: str, values: Iterable[Any], by_day: int) -> pytest.MarkDecorator:
    """Parametrise a test with ``values``; all but ``by_day`` of them, drawn by the seed ``names``, are nightly."""
    listed = [value if isinstance(value, tuple) else (value,) for value in values]
    chosen = set(random.Random(names).sample(range(len(listed)), by_day))
    return pytest.mark.parametrize(
        names,
        [
            pytest.param(*value, id="-".join(map(str, value)), marks=() if number in chosen else pytest.mark.nightly)
            for number, value in enumerate(listed)
        ],
    )
