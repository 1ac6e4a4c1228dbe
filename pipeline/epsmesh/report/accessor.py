"""What a dataset can do by itself, as ``dataset.epsmesh``: table, picture, Pareto front, guide."""

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from epsmesh.quantities import MESH_DIMENSIONS
from epsmesh.report.answer import Guide
from epsmesh.report.compare import Comparison, compare
from epsmesh.report.compliance import Against, compliance
from epsmesh.report.guide import guide
from epsmesh.report.locate import Located, locate
from epsmesh.report.pareto import front, is_by_chance
from epsmesh.report.values import at_peak, elastic, relative, with_words
from epsmesh.report.words import choices, heading

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

# More curves than this are drawn as bands, from the least to the most over the scenes.
_MOST_CURVES = 7
# Dimensions of what a case has several of.
_INNER = ("component", "movement", "reaction", "region", "decided")
# The coordinate with the unit of each entry of a stiffness.
_UNIT = "stiffness_unit"


@xr.register_dataset_accessor("epsmesh")
class Accessor:
    """Questions that a study's dataset answers: ``dataset.epsmesh``."""

    def __init__(self, dataset: xr.Dataset):
        self._dataset = with_words(dataset)

    def relative(self, error: str) -> xr.DataArray:
        """Return an error bar as a share of its value: "force_error" over force, and so for every ``…_error``.

        Raises:
            ValueError: if the dataset has no such error.
        """
        return relative(self._dataset, error)

    def to_frame(self) -> "pd.DataFrame":
        """Return a pandas frame with a row for each case and a column for each variable, SI units.

        Labels are columns as well; the components of the force are ``force_x``, ``force_y`` and ``force_z``, their
        error bars ``force_error_x`` …, the entries of a stiffness ``stiffness_x_rx`` … and ``stiffness_error_x_rx`` ….
        The frame's ``attrs["units"]`` holds the unit of each column that has one.
        """
        inner = [name for name in _INNER if name in self._dataset.dims]
        parts = [name for name, values in self._dataset.data_vars.items() if set(values.dims) & set(inner)]
        data = self._dataset.drop_vars([*inner, *parts, _UNIT], errors="ignore")
        of_entries: dict[str, str] = {}
        for name in parts:
            values = self._dataset[name]
            own = [dim for dim in inner if dim in values.dims]
            for labels in itertools.product(*(values[dim].values for dim in own)):
                column = "_".join([str(name).replace("_vector", ""), *map(str, labels)])
                entry = values.sel(dict(zip(own, labels, strict=True)))
                if _UNIT in entry.coords:
                    of_entries[column] = str(entry[_UNIT].values)
                data[column] = entry.drop_vars([*own, _UNIT], errors="ignore")
        dims = list(self._dataset["force"].dims)
        if dims:
            frame = data.to_dataframe(dim_order=dims).reset_index()
        else:
            frame = data.expand_dims("case").to_dataframe().reset_index(drop=True)
        units = {str(n): v.attrs["units"] for n, v in data.variables.items() if "units" in v.attrs} | of_entries
        frame.attrs["units"] = {name: units[name] for name in frame.columns if name in units}
        return frame

    def at_peak(self) -> xr.Dataset:
        """Return the dataset at the time of each case's largest force, without the dimension ``time``."""
        return at_peak(self._dataset)

    def finite_epsilon(self) -> xr.Dataset:
        """Return the dataset without the full order, whose ε is infinite: for ``interp`` and maps over ε.

        ``force_max`` and the ratios have what it found.
        """
        if "epsilon" not in self._dataset.dims:
            return self._dataset
        return self._dataset.isel(epsilon=np.isfinite(self._dataset["epsilon"].values))

    def guide(self, accuracy: str | float | None = None, budget: str | float | None = None) -> Guide:
        """Return the smallest ε for an ``accuracy`` ("5 %"), or the best setting within a ``budget`` ("10 ms").

        See :func:`epsmesh.report.guide.guide`; printed, the guide is the text of ``epsmesh guide``.
        """
        return guide(self._dataset, accuracy, budget)

    def compare(self, other: xr.Dataset) -> Comparison:
        """Return case by case whether the forces agree with those of ``other`` within the error bars.

        See :func:`epsmesh.report.compare.compare`.
        """
        return compare(self._dataset, other)

    def compliance(self, against: Against = "exact") -> xr.Dataset:
        """Return what each mesh adds to the compliance of the body, c (1/m), with its error bar and, where there is
        none, why: 1/F = 1/F_exact + c / (E d), or F_max ``against`` "full".

        See :func:`epsmesh.report.compliance.compliance`.
        """
        return compliance(self._dataset, against)

    def locate(self, body: str, healthy: str) -> Located:
        """Return where, below the path or the raster of places, a ``body`` holds what the ``healthy`` one does not.

        See :func:`epsmesh.report.locate.locate`.
        """
        return locate(self._dataset, body, healthy)

    def pareto(self) -> "pd.DataFrame":
        """Return, scene by scene, the cases that no other case of the scene beats in both time and error.

        A row of :meth:`to_frame` with ``error`` = |F/F_exact - 1| added, by scene and from the fastest on. Left out are
        errors that are small by chance: those of which a finer mesh has one 1.5 times as large.
        """
        dataset = elastic(self._dataset)
        error = abs(dataset["force_exact_ratio"] - 1).where(dataset["status"] == "ok")
        frame = Accessor(dataset.assign(error=error.where(~is_by_chance(error)))).to_frame()
        frame = frame[frame["error"].notna()]
        scene = [str(d) for d in dataset["force"].dims if d not in MESH_DIMENSIONS]
        scenes = [rows for _, rows in frame.groupby(scene)] if scene else [frame]
        best = [label for rows in scenes for label in rows.index[front(rows["time_total"], rows["error"])]]
        return frame.loc[best].reset_index(drop=True)

    def plot_ratio(
        self, ax: "Axes | None" = None, variable: str = "force_ratio", by: str | None = None, **labels: Any
    ) -> "Axes":
        """Draw F/F_max, or another ``variable``, against ε (mm), and return the axes; ``labels`` select.

        A curve for each combination of what else is swept; if these are many, a band for each mesh setting and each
        value of ``by``, from the least to the most over the other scenes. Full order is not on the axis: it is
        F/F_max = 1.

        Raises:
            ValueError: if ε, or ``by``, is not swept.
        """
        import matplotlib.pyplot as plt  # noqa: PLC0415 (slow to load)

        data = at_peak(self._dataset)[variable].sel(labels)
        if "epsilon" not in data.dims:
            raise ValueError("the dataset has no dimension epsilon to draw against")
        if by is not None and by not in data.dims:
            raise ValueError(f"by = {by!r}: no such dimension is left; there are {', '.join(map(str, data.dims))}")
        if ax is None:
            ax = plt.figure(figsize=(5, 3.4), layout="constrained").subplots()
        data = data.isel(epsilon=np.isfinite(data["epsilon"].values)).sortby("epsilon")
        others = [str(d) for d in data.dims if d != "epsilon"]
        is_few = np.prod([data.sizes[d] for d in others]) <= _MOST_CURVES
        scene = [d for d in others if not is_few and d not in (*MESH_DIMENSIONS, by)]
        _draw(ax, data, [d for d in others if d not in scene], scene)
        if variable == "force_ratio":
            ax.axhline(1.0, color="black", linewidth=0.7)
        ax.set_xlabel(heading(data["epsilon"]))
        ax.set_ylabel(heading(data))
        if ax.get_legend_handles_labels()[1]:
            ax.legend(fontsize=9)
        return ax


def _draw(ax: "Axes", data: xr.DataArray, dims: list[str], scene: list[str]) -> None:
    """Draw a curve for each combination along ``dims``: the median over the dimensions of ``scene``, in their range."""
    from epsmesh.report.figures.style import look  # noqa: PLC0415 (matplotlib is slow to load)

    x = 1e3 * data["epsilon"].values
    count = int(np.prod([data.sizes[d] for d in scene]))
    for number, labels in enumerate(_combinations(data, dims)):
        chosen, style, name = data.sel(labels), look(number), choices(data.coords, labels)
        if scene:
            low, high = chosen.min(scene).values, chosen.max(scene).values
            ax.fill_between(x, low, high, color=style["color"], alpha=0.25, linewidth=0)
            name = f"{name}{': ' if name else ''}median and range of {count} scenes"
        ax.plot(x, chosen.median(scene).values if scene else chosen.values, label=name, markersize=4, **style)


def _combinations(data: xr.DataArray, dims: list[str]) -> list[dict[str, Any]]:
    return [dict(zip(dims, values, strict=True)) for values in itertools.product(*(data[d].values for d in dims))]
