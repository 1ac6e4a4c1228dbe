"""The figures of the documentation that come of studies: ``python docs/draw_figures.py [NAME ...]``.

Each is drawn from ``results/<study>.nc``, as ``make studies`` leaves them, into ``docs/figures/<name>.png``; what has
no dataset yet is named. Pictures of meshes are of ``epsmesh view``, those of scenes of ``draw_scenes.py``.
"""

import sys
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import xarray as xr
from matplotlib.figure import Figure

import epsmesh
from epsmesh.report.figures import STYLE, figure
from epsmesh.report.figures.style import COLOURS

DOCS = Path(__file__).parent
RESULTS, PICTURES = DOCS.parent / "results", DOCS / "figures"
DPI = 130
# What the paper claims of F/F_max, at ε (mm).
PAPER = (10.0, 0.8)


def guideline(data: xr.Dataset) -> Figure:
    """F/F_max of free columns, by tissue and by tool, and the paper's claim."""
    drawn, axes = plt.subplots(1, 2, figsize=(8.4, 4.2), layout="constrained")
    for ax, by in zip(axes, ("body", "probe"), strict=True):
        data.epsmesh.plot_ratio(ax, by=by, outside="free")
        ax.plot(*PAPER, "*", markersize=13, color="#d81b60", zorder=5)
        ax.annotate("paper: 80 %", PAPER, (8, -10), textcoords="offset points", color="#d81b60", fontsize=9)
        ax.set_ylim(0, 1.05)
        ax.legend(fontsize=9, loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False)
    return drawn


def closure(data: xr.Dataset) -> Figure:
    """F/F_max of what may be beyond ε, of three scenes."""
    drawn, axes = plt.subplots(1, 3, figsize=(8.6, 3.4), sharey=True, layout="constrained")
    scenes = (("needle 1 mm", "10 mm thick"), ("trocar 3 mm", "10 mm thick"), ("blade 6 mm", "30 mm thick"))
    for ax, (probe, body) in zip(axes, scenes, strict=True):
        data.epsmesh.plot_ratio(ax, probe=probe, body=body)
        ax.set_title(f"{probe}, {body}", fontsize=9)
        ax.set_ylim(0.3, 1.2)
        if ax is not axes[0]:
            ax.get_legend().remove()
            ax.set_ylabel("")
    return drawn


def deep(data: xr.Dataset) -> Figure:
    """F/F_max against ε by depth, for each outside: the range over tools and laws, on thin and thick tissue."""
    outsides = [str(name) for name in data["outside"].values]
    drawn, axes = plt.subplots(1, len(outsides), figsize=(8.6, 4.2))
    drawn.subplots_adjust(left=0.08, right=0.98, top=0.93, bottom=0.3, wspace=0.28)
    places = range(data.sizes["epsilon"])
    names = [f"{1e3 * value:g}" if value < float("inf") else "full" for value in data["epsilon"].values]
    lines = dict(zip(map(str, data["body"].values), ("-", "--"), strict=True))
    colours = dict(zip(map(float, data["depth"].values), COLOURS[::2], strict=False))
    for ax, outside in zip(axes, outsides, strict=True):
        for (body, line), (depth, colour) in product(lines.items(), colours.items()):
            ratio = data["force_ratio"].sel(outside=outside, body=body, depth=depth)
            low, high = ratio.min(["probe", "law"]), ratio.max(["probe", "law"])
            ax.fill_between(places, low, high, color=colour, alpha=0.12, linewidth=0)
            middle = ratio.median(["probe", "law"])
            ax.plot(
                places, middle, line, marker="o", markersize=4, color=colour, label=f"d = {1e3 * depth:g} mm, {body}"
            )
        ax.set_xticks(places, names)
        ax.set_xlabel("radius of the fine mesh ε, mm")
        ax.set_title(outside, fontsize=9)
        ax.set_ylim(*((0, 1.05) if outside == "free" else (0.93, 1.07)))
    axes[-1].plot(names.index(f"{PAPER[0]:g}"), PAPER[1], "*", markersize=11, color="#d81b60", label="paper: 80 %")
    axes[0].set_ylabel("F/F_max")
    drawn.legend(*axes[-1].get_legend_handles_labels(), fontsize=8, loc="lower center", ncols=3)
    return drawn


def of_kind(kind: str) -> Callable[[xr.Dataset], Figure]:
    """Return what draws one of the program's own figures."""
    return partial(figure, kind=kind)


# By picture: the study, and what draws it.
FIGURES: dict[str, tuple[str, Callable[[xr.Dataset], Figure]]] = {
    "figure3": ("figure3", of_kind("ratio")),
    "speedup": ("speedup", of_kind("ratio")),
    "guideline": ("guideline", guideline),
    "compliance": ("compliance", of_kind("compliance")),
    "closure": ("closure", closure),
    "path": ("path", of_kind("map")),
    "insertion": ("scalpel-path", of_kind("insertion")),
    "needle_path": ("needle-path", of_kind("insertion")),
    "deep": ("deep", deep),
    "large_depth": ("large_depth", of_kind("force")),
    "influence": ("influence", of_kind("influence")),
}


def main(names: list[str]) -> int:
    """Draw the pictures called ``names``, or all; return how many could not be drawn."""
    missing = 0
    for name in names or FIGURES:
        study, draw = FIGURES[name]
        path = RESULTS / f"{study}.nc"
        if not path.exists():
            print(f"{name}: no {path}: epsmesh run studies/{study}.toml")
            missing += 1
            continue
        with mpl.rc_context(STYLE):
            drawn = draw(epsmesh.open(path))
            drawn.savefig(PICTURES / f"{name}.png", dpi=DPI)
        plt.close(drawn)
        print(f"{name}: {PICTURES / name}.png")
    return missing


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
