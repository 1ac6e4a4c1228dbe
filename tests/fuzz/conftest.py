"""What holds for all that is thrown: none of it takes more than a gigabyte."""

import resource

import pytest

MOST_MEMORY = 1e9  # bytes


@pytest.fixture(autouse=True, scope="module")
def memory():
    """The peak of this process (bytes), which what a module throws does not raise by more than is allowed."""
    before = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    assert 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MOST_MEMORY
