"""States of a case: the words of ``status``, in records and in datasets."""

from collections.abc import Collection

OK = "ok"
FAILED = "failed"
SKIPPED = "skipped"  # a smaller ε is close enough to F_exact, or the tool does not fit
NO_CONTACT = "no contact"  # the tool does not touch the body
PENDING = "pending"  # not yet run
PARTIAL = "partial"  # the solve ended before its depth

# In the order of their flags in a file: new ones are added at the end.
STATES = (OK, FAILED, SKIPPED, NO_CONTACT, PENDING, PARTIAL)
# Those of a case that was computed, without a force at its depth.
FAILURES = (FAILED, PARTIAL)
# By how much they matter: a case with several solves has the first of their states.
WORST_FIRST = (FAILED, PARTIAL, PENDING, SKIPPED, NO_CONTACT, OK)


def worst(states: Collection[str]) -> str:
    """Return the state of a case from those of its solves; "ok" if there are none."""
    return next((state for state in WORST_FIRST if state in states), OK)
