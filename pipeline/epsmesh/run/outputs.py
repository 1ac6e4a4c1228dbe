"""The numbers of fields that a study asks for: ``[[output]]``, and where the force is decided.

Their error bars are the changes by elements of one degree more.
"""

from collections.abc import Callable
from dataclasses import replace
from math import isfinite, isnan, nan
from typing import Any

import numpy as np

from epsmesh import fitted
from epsmesh.arrays import BoolArray
from epsmesh.plan.steps import Solve
from epsmesh.run.case_solution import CaseSolution
from epsmesh.run.compile import prepare
from epsmesh.run.functions import loaded
from epsmesh.run.influence import sums_of_influence
from epsmesh.run.memory import FreeMemory
from epsmesh.run.problem import conditions_of, lacks_memory, law_of, memory_of, problem_of, solve_problem
from epsmesh.run.record import Record
from epsmesh.run.solved import Solved, compile_law, put_back
from epsmesh.solve import SolveError
from epsmesh.solve.cell_values import clear_cells
from epsmesh.solve.points.reduce import Number, at_point, over_region
from epsmesh.solve.points.state import State
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import Spaces
from epsmesh.study.case import Case
from epsmesh.study.output import OWN, WHOLE, Output

# The highest degree for which the whole case is solved again in one degree more.
_HIGHEST = 2


def with_fields(
    solve: Solve, problem: QuasiStaticProblem, spaces: Spaces, record: Record, *, has_bar: bool
) -> tuple[Record, str]:
    """Return the record with what its case asks of the fields of the last solution, and notes; collective."""
    if not (solve.case.outputs or solve.case.solve.influence):
        return record, ""
    state = problem.state()
    finer, why = (problem.finer_state, "") if has_bar else (None, "not requested")
    if has_bar and finer is None:
        finer, why = _solved_again(solve, spaces)
    notes = [f"no error bars on outputs: {why}"] if why else []
    if solve.case.solve.influence and state.influence is None:
        notes.append("no influence: the change of the solution with the depth was not found")
    elif solve.case.solve.influence:
        of_contact = 0.0 if isnan(record.contact_radius_error) else record.contact_radius_error
        record = replace(record, influence=dict(sums_of_influence(solve, state, finer, of_contact)))
    if solve.case.outputs:
        found, more = _outputs_of(solve, state, finer, record)
        record, notes = replace(record, largest=record.largest | found), [*notes, *more]
    return record, "; ".join(notes)


def _outputs_of(solve: Solve, state: State, finer: State | None, record: Record) -> tuple[dict[str, float], list[str]]:
    """Return the outputs, with their bars, by name, and notes; collective."""
    case, meshed, body = solve.case, solve.meshed_case, state.body
    law = law_of(case, in_body=True)
    compile_law(body.comm, state)
    clear = clear_cells(body, conditions_of(case).front, wholly=True)
    found: dict[str, float] = {}
    notes: list[str] = []
    undo = put_back(case, meshed, body, [each for each in (state, finer) if each is not None])
    try:
        states = [each and replace(each, law=law) for each in (state, finer)]
        for output in case.outputs:
            if output.function is not None:
                number = _of_function(output, solve, record, states)
            else:
                number = _of_fields(output, case, states[0], states[1], clear)
            bar = nan if isinstance(number, str) else _bar(output, number)
            value = nan if isinstance(number, str) else number.value
            found |= {output.name: value, f"{output.name}_error": bar}
            notes += _notes(output, number)
    finally:
        undo()
    return found, notes


def _of_fields(output: Output, case: Case, state: State | None, finer: State | None, clear: BoolArray) -> Number:
    assert output.of is not None and state is not None
    if output.at is not None:
        return at_point(output.of, np.array(output.at), state, finer, clear)
    body = state.body
    chosen = body.is_tissue
    if output.region != WHOLE and body.regions is not None:
        names = [OWN, *(region.name for region in case.body.regions)]
        # Beyond ε, the linear part of each region has a number of its own.
        chosen = body.regions[: body.owned_cells] % len(case.tissues) == names.index(str(output.region))
    return over_region(output.of, output.reduction, chosen, state, finer, clear)


def _of_function(output: Output, solve: Solve, record: Record, states: list[State | None]) -> Number | str:
    """Return the number of a function of the study's author, or why there is none; collective."""
    values: list[float] = []
    try:
        function = function_of(output)
        for state in states:
            if state is not None:
                values.append(float(function(CaseSolution(Solved(solve, record, state, None, record.dofs)))))
    except Exception as error:
        message = f"{type(error).__name__}: {error}"
    else:
        message = "" if all(map(isfinite, values)) else f"it returned {values[0]}"
    comm = states[0].body.comm if states[0] is not None else None
    assert comm is not None
    if messages := [each for each in comm.allgather(message) if each]:
        return messages[0]
    return Number(values[0], abs(values[0] - values[1]) if len(values) > 1 else nan, 0.0)


def function_of(output: Output) -> Callable[[CaseSolution], Any]:
    """Return the function of an output; this executes its file.

    Raises:
        Exception: what the file raises; AttributeError, if it has no such function.
    """
    return loaded(str(output.function))


def _bar(output: Output, number: Number) -> float:
    """Return the 95 % bar of a number; NaN if it has none."""
    if number.is_singular or number.is_outside:
        return nan
    kind = "at" if output.at is not None else output.reduction if output.reduction in ("max", "mean") else "quantile"
    return fitted.CHANGES * max(number.change, fitted.POINTWISE[str(kind)] * number.pointwise)


def _notes(output: Output, number: Number | str) -> list[str]:
    if isinstance(number, str):
        return [f"{output.name}: {number}"]
    if number.is_outside:
        return [f"{output.name}: there is no tissue there"]
    if number.is_singular:
        return [f"{output.name}: no error bar, because it grows without bound at an edge nearby as elements shrink"]
    return []


def _solved_again(solve: Solve, spaces: Spaces) -> tuple[State | None, str]:
    """Return the fields of the case in elements of one degree more on the same mesh, or why not; collective."""

    def raised(case: Case) -> Case:
        return replace(case, mesh=case.mesh.model_copy(update={"degree": case.mesh.degree + 1}), outputs=())

    degree, comm = solve.case.mesh.degree, spaces.body.comm
    if degree > _HIGHEST:
        return None, f"they need elements of degree {degree + 1}"
    case, meshed = raised(solve.case), raised(solve.meshed_case)
    prepare(comm, [replace(solve, case=case)])
    try:
        with problem_of(spaces, meshed) as problem:
            needed, _ = memory_of(case, problem.dofs)
            if missing := lacks_memory(FreeMemory(comm).available(), needed, f"degree {degree + 1}"):
                return None, missing
            solve_problem(case, problem, estimate=False, meshed=meshed)
            return problem.state(), ""
    except SolveError as error:
        return None, f"degree {degree + 1}: {error}"
