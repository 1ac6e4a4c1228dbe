"""Names that options of the command line share with the keys of a study file."""

REDUCTIONS = (
    "duplicates", "full", "scaling", "images", "moved", "axisymmetric", "symmetry", "sharing", "reuse", "reduced",
    "condensed", "stored", "all",
)  # fmt: skip

# Each is drawn by the module of its name in pipeline/report/figures.
FIGURES = (
    "epsilon", "ratio", "speedup", "exact", "convergence", "accuracy", "map", "force", "compliance", "linear",
    "contact", "loads",
)  # fmt: skip
