"""What ends its process, or takes too long, costs one item."""

import os
import time
from concurrent.futures.process import BrokenProcessPool

from tests.isolated import isolated


def _work(item):
    if item == "dies":
        os.kill(os.getpid(), 9)
    if item == "waits":
        time.sleep(60)
    return item, os.getpid()


def test_a_process_that_ends_costs_one_item():
    items = [(item,) for item in ("a", "dies", "waits", "b", "c")]
    given, found = zip(*isolated(_work, items, limit=5), strict=True)
    assert list(given) == items
    first, died, late, last, again = found
    assert isinstance(died, BrokenProcessPool)
    assert isinstance(late, TimeoutError)
    assert [first[0], last[0], again[0]] == ["a", "b", "c"]
    assert first[1] != last[1] == again[1]
