"""Studies by their names: what a name may be, and those that come with the program."""

from pathlib import Path

# The studies of the checkout, which are installed with the package.
EXAMPLES = Path(__file__).parent / "examples"


# Examples of at most 30 lines that run within a minute; the first one is what `epsmesh new NAME` writes.
SHORT = ("pad", "layers", "organ", "tumour", "needle", "cut")
# The JSON schema of study files, for editors.
SCHEMA = EXAMPLES / "study.schema.json"

# What a name may be, in words. Files are called after it, with a few letters more: theirs have 255 bytes at most.
NAME = "letters, digits, - and _, at most 200 bytes: results are called after it"
_LONGEST = 200


def is_name(name: object) -> bool:
    """Tell whether a study may be called so: results are called after it."""
    if not isinstance(name, str) or len(name.encode(errors="replace")) > _LONGEST:
        return False
    return name == name.strip() and name.replace("-", "").replace("_", "").replace(".", "").isalnum()


def examples() -> dict[str, Path]:
    """Return the studies that come with the program, by name."""
    return {path.stem: path for path in sorted(EXAMPLES.glob("*.toml"))}
