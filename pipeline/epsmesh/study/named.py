"""Names of studies, and the studies that come with the program."""

from pathlib import Path

# The studies that are installed with the package; in a checkout, its own.
_INSTALLED, _CHECKOUT = Path(__file__).parent / "examples", Path(__file__).resolve().parents[3]
EXAMPLES = _INSTALLED if _INSTALLED.is_dir() else _CHECKOUT / "studies"


# Examples of at most 30 lines that run within a minute; the first one is what `epsmesh new NAME` writes.
SHORT = ("pad", "layers", "organ", "tumour", "needle", "cut")
# The JSON schema of study files, for editors, beside them.
SCHEMA = "study.schema.json"

# Allowed names, in words. Results have the name, with a few letters more, and at most 255 bytes.
NAME = "letters, digits, - and _, at most 200 bytes, since results have that name, too"
_LONGEST = 200


def is_name(name: object) -> bool:
    """Return whether a study may have this name. Results have it, too."""
    if not isinstance(name, str) or len(name.encode(errors="replace")) > _LONGEST:
        return False
    return name == name.strip() and name.replace("-", "").replace("_", "").replace(".", "").isalnum()


def examples() -> dict[str, Path]:
    """Return the studies that come with the program, by name."""
    return {path.stem: path for path in sorted(EXAMPLES.glob("*.toml"))}
