"""The origin of a record: versions, commit, host and ranks."""

import platform
import subprocess
from functools import cache
from pathlib import Path

from epsmesh import __version__


def provenance(ranks: int) -> dict[str, str | int]:
    """Return versions, git commit, host and ranks; without solver no versions of it."""
    try:
        from epsmesh import compat  # noqa: PLC0415 (what needs no solver has an origin, too)
    except ModuleNotFoundError:
        versions = {}
    else:
        versions = {f"version_{name}": version for name, version in compat.versions().items()}
    return {
        **versions,
        "version_epsmesh": __version__,
        "git_commit": git_commit(),
        "host": platform.node(),
        "ranks": ranks,
    }


@cache
def git_commit() -> str:
    """Return the commit of this checkout, with ``+`` if files differ; '' outside a checkout."""
    folder = Path(__file__).resolve().parents[3]
    if not (folder / ".git").exists():
        return ""
    try:
        run = ["git", "-C", str(folder), "describe", "--always", "--abbrev=12", "--dirty=+", "--exclude=*"]
        return subprocess.run(run, capture_output=True, text=True, timeout=10, check=True).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""
