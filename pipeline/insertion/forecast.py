"""What an insertion will cost, before any of its states is solved."""

from dataclasses import replace
from typing import NoReturn

from pipeline.insertion.states import Scene
from pipeline.plan.cost import CostModel
from pipeline.plan.describe import summary
from pipeline.plan.plan import make_plan
from pipeline.study.sweep import Study
from pipeline.surrogate.forecast import Forecast


def forecast(study: Study, cost: CostModel) -> Forecast:
    """Return about what the insertion of a study costs at most, with times of a cost model.

    Raises:
        StudyError: if the study has no insertion, or is not one scene.
    """
    scene = Scene(study, _unsolved)
    middle = scene.clear(scene.insertion.to / 2)
    states = scene.slit_study([middle], scene.ahead(middle))
    seconds = float(summary(replace(make_plan(states), cost=cost))["seconds"])
    # The intact body, every depth, and one more slit before the puncture.
    count = scene.insertion.steps + 2
    return Forecast(count, count, count * seconds, count * seconds)


def _unsolved(study: Study) -> NoReturn:
    raise AssertionError(f"{study.file}: a forecast solves nothing")
