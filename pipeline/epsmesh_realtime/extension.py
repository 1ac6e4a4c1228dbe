"""What this package tells in `epsmesh plan`: the cost of an export, as :mod:`epsmesh.extensions` finds it."""

from epsmesh.extensions import Forecast
from epsmesh.plan.cost import CostModel
from epsmesh.study.sweep import Study
from epsmesh_realtime.export.forecast import Export
from epsmesh_realtime.export.scope import ExportError, scope_of


def forecast(study: Study, cost: CostModel, ranks: int) -> Forecast:
    """Return about what `epsmesh export` costs, without options; or the reason, ``refused``, why there is no model."""
    try:
        found = Export(scope_of(study), cost=cost).forecast()
    except ExportError as reason:
        refused = str(reason).removeprefix(f"{study.file}: ")
        return Forecast({"command": "export", "refused": refused}, f"  export: no real-time model: {refused}")
    warned = f"; {found.warning}" if found.warning else ""
    line = f"  export, as a real-time model: {found.text(ranks)}{warned}"
    return Forecast({"command": "export", **vars(found)}, line)
