"""Where something stiff lies below a surface: the centre of the force's excess over that on a body without it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from epsmesh.report.study import DatasetError
from epsmesh.report.values import at_peak, by_case, relative
from epsmesh.report.words import barred

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_RASTER, _PATH = ("x", "y"), ("path",)


@dataclass(frozen=True, eq=False)
class Located:
    """What a map of forces says of a place below.

    ``point`` (m) is the centre of the excess on the surface and ``axis`` the tool's mean direction there: what is
    sought lies on the line through it, at a depth that one map does not tell. ``error`` (m) is what the error bars
    leave open of the point's coordinates. ``excess`` is F / F_healthy - 1 and ``bar`` its error bar, along the path
    or the raster; ``reaches_edge`` says that the excess goes on beyond its ends, which draws the centre inward.
    """

    point: tuple[float, float, float]
    axis: tuple[float, float, float]
    error: tuple[float, float, float]
    excess: xr.DataArray
    bar: xr.DataArray
    reaches_edge: bool

    def distance(self, place: tuple[float, float, float]) -> float:
        """Return how far (m) a place is from the line that was found."""
        return float(np.linalg.norm(np.cross(np.array(place) - np.array(self.point), self.axis)))

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the excess (%) and the centre that was found, and return the axes."""
        import matplotlib.pyplot as plt  # noqa: PLC0415 (slow to load)

        from epsmesh.report.figures.map import draw_excess  # noqa: PLC0415

        if ax is None:
            ax = plt.figure(figsize=(5, 3.4), layout="constrained").subplots()
        if (drawn := draw_excess(ax, self.excess, self.bar, self.point)) is not None:
            ax.get_figure().colorbar(drawn, ax=ax, label="excess of F, %")
            ax.legend(fontsize=9, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncol=2, facecolor="#9aa0a6")
        return ax

    def __str__(self) -> str:
        x, y, z = (barred(1e3 * c, 1e3 * e, "mm") for c, e in zip(self.point, self.error, strict=True))
        axis = ", ".join(f"{c:.2f}" for c in self.axis)
        edge = "; the excess reaches the edge of what was mapped" if self.reaches_edge else ""
        return f"below x = {x}, y = {y}, z = {z}, along ({axis}){edge}"


def locate(dataset: xr.Dataset, body: str, healthy: str) -> Located:
    """Return where a ``body`` takes more force than the ``healthy`` one, beyond the error bars of both.

    The excess e = F / F_healthy - 1 has the bar b = (1 + e) (b₁ + b₂) of the relative bars of both forces. The centre
    is that of max(e - b, 0) over the surface as the path or the raster covers it; ``error`` is what the bars of the
    places that count, each by itself, move it by.

    Raises:
        DatasetError: if there is no path, if more is swept than it and the bodies, or if nowhere is the excess beyond
            its bar.
    """
    dataset = at_peak(dataset)
    dims = _dimensions(dataset)
    dataset = dataset.isel({dim: 0 for dim in dataset["force"].dims if dim not in (*dims, "body")})
    for name in (body, healthy):
        if name not in dataset["body"].values:
            raise DatasetError(f"no body is called {name!r}: there are {', '.join(map(str, dataset['body'].values))}")
    with_it, without = (dataset.sel(body=name).transpose(*dims, ...) for name in (body, healthy))
    touched = (with_it["status"] == "ok") & (without["status"] == "ok")
    excess = (with_it["force"] / without["force"] - 1).where(touched)
    bar = (1 + excess) * (relative(with_it, "force_error") + relative(without, "force_error"))
    weight = (excess - bar).clip(min=0).fillna(0) * _areas(dataset, dims)
    beyond, total = (weight > 0).values, float(weight.sum())
    if not total > 0:
        raise DatasetError("nowhere is the force beyond the error bars of both larger than on the healthy body")
    places = np.stack([by_case(with_it, f"at_{c}").values for c in "xyz"], axis=-1)[beyond]
    shares = weight.values[beyond] / total
    point = shares @ places
    areas = np.broadcast_to(_areas(dataset, dims).values, weight.shape)[beyond]
    moved = (areas * bar.values[beyond] / total)[:, None] * (places - point)
    axis = shares @ by_case(with_it, "axis").values[beyond]
    return Located(
        point=_vector(point),
        axis=_vector(axis / np.linalg.norm(axis)),
        error=_vector(np.sqrt((moved**2).sum(axis=0))),
        excess=excess,
        bar=bar,
        reaches_edge=_touches_edge(beyond),
    )


def _dimensions(dataset: xr.Dataset) -> tuple[str, ...]:
    swept = {str(dim) for dim in dataset["force"].dims if dataset.sizes[dim] > 1}
    dims = next((dims for dims in (_RASTER, _PATH) if {*dims} <= {*dataset.dims}), None)
    if dims is None or "body" not in dataset.dims:
        raise DatasetError("needs a [probe.path], and [[body]] tables with and without what is sought")
    if more := sorted(swept - {"body", *dims}):
        raise DatasetError(f"select one value of {', '.join(more)} first: dataset.sel({more[0]}=…)")
    return dims


def _areas(dataset: xr.Dataset, dims: tuple[str, ...]) -> xr.DataArray:
    """Return how much of the raster, seen from above (m²), or of the path (m), each place stands for."""
    steps = [xr.DataArray(np.gradient(dataset[dim].values), dims=dim) for dim in dims]
    return steps[0] if len(steps) == 1 else (steps[0] * steps[1]).transpose(*dims)


def _touches_edge(beyond: np.ndarray) -> bool:
    ends = [np.take(beyond, end, axis=axis) for axis in range(beyond.ndim) for end in (0, -1)]
    return any(bool(np.any(end)) for end in ends)


def _vector(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = map(float, values)
    return x, y, z
