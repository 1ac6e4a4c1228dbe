"""An axis of a sweep: a list, or an array of tables in a study file."""

from dataclasses import dataclass

from epsmesh.quantities import write

# Keys that both body and probe have, or a variable of the dataset: their dimension says whose it is.
_AMBIGUOUS = ("radius", "shape", "accuracy", "axis", "force")
# Keys of a section that another has, too, whose dimension has the name alone.
_LIKE_THAT = {"body": ("axes",), "probe": ("young", "poisson", "height")}
# Tables with keys that have the names of others.
_LIKE_OTHERS = ("spread",)


@dataclass(frozen=True)
class Axis:
    """One swept input: a dimension of the dataset."""

    section: str
    key: str  # "" for an array of tables, which sweeps the section as a whole
    labels: tuple[float | int | str, ...]
    unit: str
    piece: str = ""  # of an array of tables within the section, such as layer[2]
    owner: str = ""  # the name of that piece
    is_stage: bool = False  # what is solved on the way of a history, or of an insertion, which is one case
    off: str = ""  # of a path: what becomes of places off the body, "refuse" or "no contact"

    @property
    def name(self) -> str:
        """Name of the dimension in the dataset."""
        if not self.key:
            return self.section
        if own := "_".join(filter(None, (self.owner, self._table))):
            return f"{own}_{self.key}"
        is_ambiguous = self.key in _AMBIGUOUS or self.key in _LIKE_THAT.get(self.section, ())
        return f"{self.section}_{self.key}" if is_ambiguous else self.key

    @property
    def _table(self) -> str:
        """The table that it is in, if its keys have the names of others."""
        table = self.piece.rpartition(".")[2]
        return table if table in _LIKE_OTHERS else ""

    @property
    def path(self) -> str:
        """Place in the study file."""
        if self.is_stage:
            return f"probe.{self.piece}"
        if self.off:
            return "probe.path" if self.key == "path" else f"probe.path.raster.{self.key}"
        return ".".join(part for part in (self.section, self.piece, self.key) if part)

    @property
    def words(self) -> str:
        """Its place in the study file in words: ``direction of the fibres``."""
        table = self.piece.rpartition(".")[2].partition("[")[0] or self.section
        return f"{self.key} of {self.owner or f'the {table}'}".replace("_", " ") if self.key else self.section

    def write(self, label: float | int | str) -> str:
        """Write one of its labels as people read it."""
        return write(self.name, label, self.unit)

    def __len__(self) -> int:
        return len(self.labels)
