"""What `epsmesh view` tells of the file of a force curve."""

from pathlib import Path

from epsmesh.cli.console import say
from epsmesh.cli.faults import refusing
from epsmesh.printable import printable_lines


def view(path: Path) -> None:
    """Print what is in the file, and a ``[[measurement]]`` to paste into a study."""
    from epsmesh_identify.experiment.describe import describe
    from epsmesh_identify.experiment.reading import ExperimentError

    with refusing(ExperimentError, file=path, howto="docs/guide/identify.md"):
        text = describe(path)
    say({"curve": str(path), "text": text}, printable_lines(text))
