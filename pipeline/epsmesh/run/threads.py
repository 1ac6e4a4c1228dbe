"""Threads of BLAS: one per rank, since idle threads of OpenBLAS spin and would take the other ranks' cores."""

import sys
from functools import lru_cache
from typing import Any

from threadpoolctl import ThreadpoolController


def one_thread() -> Any:
    """Return a context in which each BLAS library of this process has one thread."""
    return _libraries(len(sys.modules)).limit(limits=1, user_api="blas")


@lru_cache(maxsize=1)
def _libraries(modules: int) -> ThreadpoolController:
    """Return the libraries with threads, searched for (4 ms) whenever the number of ``modules`` has changed."""
    return ThreadpoolController()
