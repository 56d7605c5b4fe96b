"""Searches on OMPL; nothing of OMPL is imported or kept anywhere else.

OMPL's random generator belongs to the process and is seeded before each search; a lock keeps
searches of several threads apart. Whatever OMPL can reach holds arrays and our own objects only:
a path from a motion validator back to its space information would never be freed.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from planners.edge_checker import EdgeChecker
from planners.result import PlanStatus
from systems.system import Array

_process_wide = threading.Lock()
Search = Callable[["Clock"], Array | None]


@dataclass(frozen=True)
class Budget:
    """How long to search.

    Attributes
    ----------
    max_iterations : int
        Samples to draw.
    time_limit : float or None
        Seconds.
    """

    max_iterations: int
    time_limit: float | None

    def start(self) -> Clock:
        """Start counting."""
        return Clock(self)


class Clock:
    """Counts iterations and time against a budget."""

    def __init__(self, budget: Budget) -> None:
        limit = budget.time_limit
        self._deadline = np.inf if limit is None else time.perf_counter() + limit
        self._left = budget.max_iterations
        self.status: PlanStatus | None = None

    def spent(self, n_iterations: int = 1) -> bool:
        """Count iterations to come; True when the budget does not allow them."""
        if self._left < n_iterations:
            self.status = PlanStatus.ITERATION_LIMIT
        elif time.perf_counter() > self._deadline:
            self.status = PlanStatus.TIME_LIMIT
        self._left -= n_iterations
        return self.status is not None


def rrt_connect(
    bounds: Array,
    start: Array,
    goals: Array,
    checker: EdgeChecker,
    *,
    longest_edge: float,
    budget: Budget,
    seed: int,
) -> tuple[PlanStatus, Array | None]:
    """Run OMPL's own RRT-Connect with every motion checked by ``checker``.

    RRT-Connect asks about an edge in the direction from start to goal in both of its trees, and
    adds every edge that is accepted.

    Parameters
    ----------
    bounds : ndarray of shape (2, d)
    start : ndarray of shape (d,)
    goals : ndarray of shape (n_goals, d)
    checker : EdgeChecker
    longest_edge : float
        The planner's range.
    budget : Budget
    seed : int
        Seed of OMPL's generator, positive.

    Returns
    -------
    status : PlanStatus
    vertices : ndarray of shape (n, d) or None
        Ends of the path's edges; None without a solution.
    """
    clock = budget.start()
    with _seeded(seed):
        setup = _problem(bounds, start, goals)
        information = setup.getSpaceInformation()
        information.setMotionValidator(_EdgeValidator(information, checker, len(start)))
        try:
            planner = og.RRTConnect(information)
            planner.setRange(longest_edge)
            setup.setPlanner(planner)
            return _solve(setup, clock, len(start))
        finally:
            information.setMotionValidator(_AnyMotion(information))


def search_as_planner(
    bounds: Array,
    start: Array,
    goals: Array,
    search: Search,
    *,
    budget: Budget,
    seed: int,
) -> tuple[PlanStatus, Array | None]:
    """Run a search of ours as an OMPL planner.

    Parameters
    ----------
    search : callable
        Called with the :class:`Clock`; returns the configurations of a path, or None when the
        clock told it to stop.

    Returns
    -------
    status, vertices
        As from :func:`rrt_connect`.
    """
    clock = budget.start()
    with _seeded(seed):
        setup = _problem(bounds, start, goals)
        setup.setPlanner(_SearchPlanner(setup.getSpaceInformation(), search, clock))
        return _solve(setup, clock, len(start))


class _EdgeValidator(ob.MotionValidator):
    def __init__(self, information: Any, checker: EdgeChecker, dim: int) -> None:
        super().__init__(information)
        self._checker = checker
        self._dim = dim

    def checkMotion(self, start: Any, end: Any) -> bool:  # noqa: N802
        edge = np.array([start[0 : self._dim], end[0 : self._dim]])
        return bool(self._checker.accept(edge[:1], edge[1:])[0])


class _AnyMotion(ob.MotionValidator):
    def checkMotion(self, start: Any, end: Any) -> bool:  # noqa: N802
        return True


class _SearchPlanner(ob.Planner):
    def __init__(self, information: Any, search: Search, clock: Clock) -> None:
        super().__init__(information, "search")
        self._search = search
        self._clock = clock

    def solve(self, termination: Any) -> Any:
        vertices = self._search(self._clock)
        if vertices is None:
            return ob.PlannerStatus(ob.PlannerStatus.TIMEOUT)
        information = self.getSpaceInformation()
        path = og.PathGeometric(information)
        for vertex in vertices:
            path.append(_state(information, vertex))
        self.getProblemDefinition().addSolutionPath(path, False, 0.0, self.getName())
        return ob.PlannerStatus(ob.PlannerStatus.EXACT_SOLUTION)


@contextmanager
def _seeded(seed: int) -> Iterator[None]:
    with _process_wide:
        level = ou.getLogLevel()
        # OMPL calls a second seeding an error, though it works.
        ou.setLogLevel(ou.LOG_NONE)
        try:
            ou.RNG.setSeed(seed)
            yield
        finally:
            ou.setLogLevel(level)


def _always(state: Any) -> bool:
    return True


def _problem(bounds: Array, start: Array, goals: Array) -> Any:
    setup = og.SimpleSetup(_space(bounds))
    information = setup.getSpaceInformation()
    # Validity is g's business, and g judges motions.
    setup.setStateValidityChecker(_always)
    setup.addStartState(_state(information, start))
    states = ob.GoalStates(information)
    for goal in goals:
        states.addState(_state(information, goal))
    setup.setGoal(states)
    return setup


def _solve(setup: Any, clock: Clock, dim: int) -> tuple[PlanStatus, Array | None]:
    setup.solve(ob.PlannerTerminationCondition(clock.spent))
    # OMPL's status is true for approximate solutions as well.
    if not setup.haveExactSolutionPath():
        return clock.status or PlanStatus.ITERATION_LIMIT, None
    states = setup.getSolutionPath().getStates()
    return PlanStatus.SOLVED, np.array([state[0:dim] for state in states])


def _space(bounds: Array) -> Any:
    space = ob.RealVectorStateSpace(bounds.shape[1])
    limits = ob.RealVectorBounds(bounds.shape[1])
    for i, (low, high) in enumerate(bounds.T):
        limits.setLow(i, float(low))
        limits.setHigh(i, float(high))
    space.setBounds(limits)
    return space


def _state(information: Any, configuration: Array) -> Any:
    state = information.allocState()
    state[0 : len(configuration)] = configuration.tolist()
    return state
