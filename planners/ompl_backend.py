"""OMPL's own RRT-Connect, run on our problems.

OMPL's random numbers come from generators that are all seeded from one sequence of the process.
Here that sequence is borrowed for as long as it takes to seed a search's generators, and then put
back to where it was. Whatever OMPL can reach holds arrays and our own objects only: a path from a
motion validator back to its space information would never be freed.
"""

from __future__ import annotations

import os
import threading
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from planners.budget import Budget
from planners.edge_checker import EdgeChecker
from planners.planning_problem import PlanningProblem
from systems.system import Array

# Longer sequences of seeds are not replayed: 1,000 seeds take two milliseconds.
MOST_SEEDS_REPLAYED = 1000


def ompl_rrt_connect(
    problem: PlanningProblem,
    checker: EdgeChecker,
    longest_edge: float,
    budget: Budget,
    seed: int,
) -> Array | None:
    """Run OMPL's RRT-Connect with every motion checked by ``checker``.

    RRT-Connect asks about an edge in the direction from start to goal in both of its trees, and
    adds every edge that is accepted.

    Parameters
    ----------
    problem : PlanningProblem
    checker : EdgeChecker
    longest_edge : float
        The planner's range.
    budget : Budget
    seed : int
        Seed of OMPL's random numbers, positive.

    Returns
    -------
    vertices : ndarray of shape (n, d) or None
        Ends of the path's edges; None without a solution.
    """
    with _silence, _BorrowedSeeds(seed) as seeds:
        setup = _simple_setup(problem)
        information = setup.getSpaceInformation()
        information.setMotionValidator(
            _EdgeValidator(information, checker, problem.starts.shape[1])
        )

        def exhausted() -> bool:
            # OMPL has seeded all generators of the search before it first asks.
            seeds.give_back()
            return budget.exhausted()

        try:
            planner = og.RRTConnect(information)
            planner.setRange(longest_edge)
            setup.setPlanner(planner)
            setup.solve(ob.PlannerTerminationCondition(exhausted))
            return _solution(setup, problem.starts.shape[1])
        finally:
            information.setMotionValidator(_AnyMotion(information))


def _simple_setup(problem: PlanningProblem) -> Any:
    setup = og.SimpleSetup(real_vector_space(problem.system.bounds))
    information = setup.getSpaceInformation()
    # The motion validator asks g about whole motions.
    setup.setStateValidityChecker(ob.AllValidStateValidityChecker(information))
    for start in problem.starts:
        setup.addStartState(_state(information, start))
    goals = ob.GoalStates(information)
    for goal in problem.goals:
        goals.addState(_state(information, goal))
    setup.setGoal(goals)
    return setup


def real_vector_space(bounds: Array) -> Any:
    """Make OMPL's space of real vectors within bounds, shape (2, d)."""
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


def _solution(setup: Any, dim: int) -> Array | None:
    # OMPL's status is true for approximate solutions as well.
    if not setup.haveExactSolutionPath():
        return None
    return np.array([state[0:dim] for state in setup.getSolutionPath().getStates()])


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


class _Silence:
    """Keeps OMPL from logging while any thread searches."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self._n_searches = 0
        self._level: Any = None

    def __enter__(self) -> None:
        with self.lock:
            if self._n_searches == 0:
                self._level = ou.getLogLevel()
                ou.setLogLevel(ou.LOG_NONE)
            self._n_searches += 1

    def __exit__(self, *_: object) -> None:
        with self.lock:
            self._n_searches -= 1
            if self._n_searches == 0:
                ou.setLogLevel(self._level)


class _BorrowedSeeds:
    """OMPL's process-wide sequence of seeds, begun anew at a seed and then put back.

    The lock keeps threads apart while they seed. It is not held during a search, so that
    estimators and systems may themselves plan.
    """

    lock = threading.Lock()

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._borrowed = False

    def __enter__(self) -> _BorrowedSeeds:
        self.lock.acquire()
        self._borrowed = True
        self._first = ou.RNG.getSeed()
        self._next = ou.RNG().getLocalSeed()
        # OMPL calls a second seeding an error in its log, though it works.
        ou.RNG.setSeed(self._seed)
        return self

    def __exit__(self, *_: object) -> None:
        self.give_back()

    def give_back(self) -> None:
        """Put the sequence back to where it was; does nothing the second time."""
        if self._borrowed:
            self._borrowed = False
            _put_back(self._first, self._next)
            self.lock.release()


def _put_back(first: int, following: int) -> None:
    """Make OMPL's sequence of seeds be the one of ``first``, with ``following`` up next."""
    ou.RNG.setSeed(first)
    replayed = (ou.RNG().getLocalSeed() for _ in range(MOST_SEEDS_REPLAYED))
    n_used = next((i for i, seed in enumerate(replayed) if seed == following), None)
    if n_used is None:
        # What follows still depends only on the user's seed.
        ou.RNG.setSeed(following)
        return
    ou.RNG.setSeed(first)
    for _ in range(n_used):
        ou.RNG()


_silence = _Silence()


def _renew_locks() -> None:
    # A child that was forked while another thread held a lock would wait for that thread for ever.
    _silence.lock = threading.Lock()
    _BorrowedSeeds.lock = threading.Lock()


os.register_at_fork(after_in_child=_renew_locks)
