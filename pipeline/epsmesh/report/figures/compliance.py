"""E d / F against 1 / a: lines as far apart as the compliance that each ε adds, whatever the tool."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epsmesh.report.compliance import sinking, tool_dimension
from epsmesh.report.figures.curves import grid, share
from epsmesh.report.figures.facets import arrange
from epsmesh.report.figures.style import finish, look
from epsmesh.report.values import at_full_order, relative
from epsmesh.report.words import choice

_PER_MM = 1e-3  # of 1/m
_ROOM = 1.04  # to the right of the last tool
_WHOLE = "whole_compliance"
_DRAWN = ["position", _WHOLE, "of_full_order", "force_bar", "touch"]
_OF_CONTACT = {"bonded": {"linestyle": "--", "markerfacecolor": "none"}}


def compliance(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """E d / F of tools with a known footprint, for each ε; lines: full order's, raised by one c for all of a kind."""
    data, heading = _with_positions(dataset)
    facets = arrange(data, (_WHOLE,), tool_dimension(dataset), flat=("epsilon",), most=(1, 3, 3))
    figure, panels = grid(data, [facets], (_WHOLE,))
    for panel in panels:
        _draw(panel.ax, panel.data)
        if panel.ax.get_xlabel():
            panel.ax.set_xlabel(heading)
        panel.ax.set_ylabel(f"{'' if panel.column else 'compliance '}E d / F, 1/mm")
    share(panels)
    end = _ROOM * max(panel.ax.get_xlim()[1] for panel in panels)
    for panel in panels:
        panel.ax.set_xlim(0, end)
    contacts = np.unique(data["touch"].values.astype(str))
    tells = "Each line is one ε. Parallel lines: an ε-mesh adds the same compliance to every tool. "
    tells += "E is that of [material], or of the top layer."
    bonded = "Dashed: bonded." if "bonded" in contacts and len(contacts) > 1 else ""
    finish(figure, title, " ".join(filter(None, (tells, bonded, facets.note))), warning)
    return figure


def shows_tools(dataset: xr.Dataset) -> bool:
    """Tell whether two tools at least have places on the axis: else there is nothing to draw."""
    if not tool_dimension(dataset):
        return False
    data, _ = _with_positions(dataset)
    places = data["position"].where(np.isfinite(data[_WHOLE])).values
    return len(np.unique(places[np.isfinite(places)].round(6))) > 1


def _with_positions(dataset: xr.Dataset) -> tuple[xr.Dataset, str]:
    """Return the dataset with E d / F and where each tool stands on the axis (1/mm), and the axis's heading.

    Round flat tools stand at 1 / a, what else there is at E d / F of full order.
    """
    known = sinking(dataset)
    linear = known[["scale", "inverse"]].where(known["exponent"] == 1)
    whole, inverse = _PER_MM * linear["scale"] / dataset["force"], _PER_MM * linear["inverse"]
    is_round = bool(np.isfinite(inverse.where(np.isfinite(whole), 0.0)).all())
    full = at_full_order(whole).broadcast_like(whole)
    places = {"position": inverse if is_round else full, "of_full_order": full}
    places["force_bar"] = relative(dataset, "force_error")
    data = dataset.assign({_WHOLE: whole, "touch": known["contact"], **places})
    return data, "1 / radius of the tool a,\n1/mm" if is_round else "compliance at full order\nE d / F_max, 1/mm"


def _draw(ax: Axes, data: xr.Dataset) -> None:
    """Draw the tools of one panel: bars of F, and full order's line raised by the mean of what is added."""
    data = data[_DRAWN]
    contacts = np.unique(data["touch"].values.astype(str))
    order = np.argsort(data["epsilon"].values)[::-1]
    for number, place in enumerate(order):
        line = data.isel(epsilon=int(place))
        for contact in contacts:
            style = look(number) | (_OF_CONTACT.get(contact, {}) if len(contacts) > 1 else {})
            label = choice(data["epsilon"], line["epsilon"].values[()])
            _draw_tools(ax, line.where(line["touch"] == contact), style, label)


def _draw_tools(ax: Axes, line: xr.Dataset, style: dict[str, str], label: str) -> None:
    """Draw the tools of one kind of contact at one ε."""
    x, y, full, bars = (line[name].values.astype(float) for name in ("position", _WHOLE, "of_full_order", "force_bar"))
    known = np.isfinite(x) & np.isfinite(y) & np.isfinite(full)
    if not known.any():
        return
    x, y, full, bars = (values[known] for values in (x, y, full, bars))
    ax.errorbar(x, y, np.nan_to_num(y * bars), label=label, capsize=2, elinewidth=0.8, **style | {"linestyle": "none"})
    weight = full**-2.0  # relative errors of F count alike
    along = np.argsort(x)
    raised = full + np.sum(weight * (y - full)) / weight.sum()
    lines = {"color": style["color"], "linestyle": style.get("linestyle", "-"), "linewidth": 0.8}
    ax.plot(x[along], raised[along], **lines)
