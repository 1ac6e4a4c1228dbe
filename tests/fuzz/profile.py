"""How many files are thrown: a few hundred in the suite, $EPSMESH_FUZZ in ``make fuzz``."""

import os

from hypothesis import HealthCheck, Phase, settings

# In the suite always the same ones: a new find is for `make fuzz` to make.
IN_SUITE = 100
_ASKED = int(os.environ.get("EPSMESH_FUZZ", "0"))
IS_CAMPAIGN = _ASKED > 0


def thrown(share: float = 1.0) -> settings:
    """Return the settings of a test that throws ``share`` of the number of files."""
    return settings(
        max_examples=max(round((_ASKED or IN_SUITE) * share), 1),
        derandomize=not _ASKED,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        phases=[Phase.generate, Phase.shrink] if _ASKED else [Phase.generate],
        print_blob=True,
    )
