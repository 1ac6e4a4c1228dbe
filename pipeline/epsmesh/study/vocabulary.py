"""Names that the command line and study files share."""

REDUCTIONS = (
    "duplicates",
    "full",
    "scaling",
    "mirrored",
    "translated",
    "axisymmetric",
    "symmetry",
    "shared-mesh",
    "initial-guess",
    "reduced",
    "condensed",
    "path",
    "stored",
    "all",
)

# Each is drawn by the module of its name in pipeline/epsmesh/report/figures.
FIGURES = ("insertion", "history", "ratio", "error", "force", "map", "compliance", "influence")
