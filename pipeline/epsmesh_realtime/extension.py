"""What this package tells in `epsmesh plan`: the cost of an export, as :mod:`epsmesh.extensions` finds it."""

from epsmesh.extensions import Forecast
from epsmesh.plan.cost import CostModel
from epsmesh.study.sweep import Study
from epsmesh_realtime.export.forecast import Export
from epsmesh_realtime.export.forecast import Forecast as Solves
from epsmesh_realtime.export.insertion import tool_of
from epsmesh_realtime.export.scope import ExportError, scope_of


def forecast(study: Study, cost: CostModel, ranks: int) -> Forecast:
    """Return about what `epsmesh export` costs, without options; or the reason, ``refused``, why there is no model."""
    try:
        if study.is_insertion:
            tool_of(study)
            line = "  export, as the real-time model of its path: nothing to solve besides"
            return Forecast({"command": "export", **vars(Solves())}, line)
        found = Export(scope_of(study), cost=cost).forecast()
    except ExportError as reason:
        refused = str(reason).removeprefix(f"{study.file}: ")
        return Forecast({"command": "export", "refused": refused}, f"  export: no real-time model: {refused}")
    warned = f"; {found.warning}" if found.warning else ""
    line = f"  export, as a real-time model: {found.text(ranks)}{warned}"
    return Forecast({"command": "export", **vars(found)}, line)
