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
from epsmesh.report.compliance import sinking
from epsmesh.report.figures import STYLE, figure
from epsmesh.report.figures.style import COLOURS

DOCS = Path(__file__).parent
RESULTS, PICTURES = DOCS.parent / "results", DOCS / "figures"
DPI = 130
# Tools of compliance.toml, by their contact.
MARKS = {"o": "slides", "s": "sticks", "^": "ball", "D": "cone"}
KINDS: dict[str, Callable[[str], bool]] = {
    "slides": lambda name: name.endswith("mm"),
    "sticks": lambda name: name.endswith("sticks"),
    "ball": lambda name: name == "ball",
    "cone": lambda name: name == "cone",
}
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


def one_number(data: xr.Dataset) -> Figure:
    """c of every tool over that of the smallest disc that slides, against the mean square distance of F, over ε²."""
    found = data.epsmesh.compliance("full")["compliance"].sel(outside="free")
    square = sinking(data).assign_coords(data.coords)["square"].sel(outside="free")
    drawn, axes = plt.subplots(1, 2, figsize=(8.4, 3.4), sharey=True, layout="constrained")
    for ax, nu in zip(axes, data["poisson"].values, strict=True):
        for epsilon, colour in zip((5e-3, 7e-3, 10e-3), COLOURS, strict=False):
            c, m = (part.sel(poisson=nu, epsilon=epsilon) for part in (found, square))
            least = float(c.sel(probe="disc 0.5 mm"))
            for marker, kind in MARKS.items():
                tools = [name for name in map(str, c["probe"].values) if KINDS[kind](name)]
                x, y = m.sel(probe=tools) / epsilon**2, c.sel(probe=tools) / least
                ax.plot(
                    x,
                    100 * (y - 1),
                    marker,
                    color=colour,
                    markersize=5,
                    fillstyle="none" if kind == "sticks" else "full",
                )
            ax.plot([], [], "-", color=colour, label=f"ε = {1e3 * epsilon:g} mm")
        ax.set_title(f"ν = {nu:g}", fontsize=9)
        ax.set_xlabel("mean square distance of the load over ε², m²/ε²")
    for marker, kind in MARKS.items():
        axes[1].plot([], [], marker, color="black", fillstyle="none" if kind == "sticks" else "full", label=kind)
    axes[0].set_ylabel("compliance c beyond that of\nthe smallest disc, %")
    axes[0].legend(handles=axes[0].get_legend_handles_labels()[0], fontsize=9)
    axes[1].legend(handles=axes[1].get_legend_handles_labels()[0][-len(MARKS) :], fontsize=9)
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


def path_excess(data: xr.Dataset) -> Figure:
    """By how much the tumour makes a needle's force larger, and where it is found."""
    found = data.epsmesh.locate(body="with a tumour", healthy="healthy").plot().figure
    assert isinstance(found, Figure)
    return found


def of_kind(kind: str) -> Callable[[xr.Dataset], Figure]:
    """Return what draws one of the program's own figures."""
    return partial(figure, kind=kind)


# By picture: the study, and what draws it.
FIGURES: dict[str, tuple[str, Callable[[xr.Dataset], Figure]]] = {
    "figure3": ("figure3", of_kind("ratio")),
    "speedup": ("speedup", of_kind("ratio")),
    "guideline": ("guideline", guideline),
    "compliance": ("compliance", of_kind("compliance")),
    "one_number": ("compliance", one_number),
    "closure": ("closure", closure),
    "needles": ("needles", of_kind("force")),
    "path": ("path", of_kind("map")),
    "path_excess": ("path", path_excess),
    "retractor": ("retractor", of_kind("force")),
    "insertion": ("scalpel-path", of_kind("insertion")),
    "insertion_layers": ("scalpel-layers", of_kind("insertion")),
    "insertion_epsilon": ("scalpel-epsilon", of_kind("insertion")),
    "needle_path": ("needle-path", of_kind("insertion")),
    "punch_path": ("punch-path", of_kind("insertion")),
    "deep": ("deep", deep),
    "large_depth": ("large_depth", of_kind("force")),
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
