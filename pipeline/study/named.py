"""Studies by their names: what a name may be, and those that come with the program."""

from pathlib import Path

# The studies of the checkout, which are installed with the package.
EXAMPLES = Path(__file__).parent / "examples"


def is_name(name: str) -> bool:
    """Tell whether a study may be called so: results are called after it."""
    return name == name.strip() and name.replace("-", "").replace("_", "").replace(".", "").isalnum()


def examples() -> dict[str, Path]:
    """Return the studies that come with the program, by name."""
    return {path.stem: path for path in sorted(EXAMPLES.glob("*.toml"))}
