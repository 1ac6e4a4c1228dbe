"""Forces over time: each elastic force times a function of time, which follows from history and relaxation alone."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.study.sweep import Case
from pipeline.viscoelastic import Motion, Terms, respond

_MANY = 10_000


@dataclass(frozen=True)
class Course:
    """What a case does over time (n,), NaN after the end of its history.

    ``factor`` is the force in units of the elastic force at ``case.probe.depth``, ``depth`` (m) that of the tool,
    ``dissipated`` the dissipated energy in units of the elastic energy, and ``peak`` the largest depth over
    ``case.probe.depth``.
    """

    factor: FloatArray
    depth: FloatArray
    dissipated: FloatArray
    peak: float


def times_of(cases: Sequence[Case]) -> FloatArray:
    """Return the times (s) of all histories of a study; none if it is static."""
    histories = {history for case in cases if (history := case.probe.history) is not None}
    return np.unique(np.concatenate([history.times() for history in histories])) if histories else np.empty(0)


def course_of(case: Case, times: FloatArray) -> Course:
    """Return what a case does at ``times``; one without a history does not change."""
    depth, history = case.probe.depth, case.probe.history
    if history is None:
        return Course(np.ones(len(times)), np.full(len(times), depth), np.zeros(len(times)), 1.0)
    return _course(history.motion(depth), case.relaxations[0], depth, tuple(times))


@lru_cache(_MANY)
def _course(motion: Motion, terms: Terms, depth: float, times: tuple[float, ...]) -> Course:
    at = np.array(times)
    force, lost = respond(motion, terms, at)
    # Energies are half of stiffness times depth squared.
    return Course(force / depth, motion.at(at), 2 * lost / depth**2, motion.largest / depth)
