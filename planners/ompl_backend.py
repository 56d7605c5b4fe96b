"""OMPL's own RRT-Connect, run on our problems.

Whatever OMPL can reach holds arrays and our own objects only: a path from a motion validator back
to its space information would never be freed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og

from planners.budget import Budget, free_edges
from planners.edge_checker import EdgeChecker
from planners.ompl_globals import BorrowedSeeds, Silence
from planners.planning_problem import PlanningProblem
from systems.system import Array


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
    with Silence(), BorrowedSeeds(seed) as seeds:
        setup = _simple_setup(problem)
        information = setup.getSpaceInformation()
        n_free = free_edges(problem.system.bounds, longest_edge)
        validator = _EdgeValidator(information, checker, problem.starts.shape[1], budget, n_free)
        information.setMotionValidator(validator)

        def exhausted() -> bool:
            # OMPL has seeded all generators of the search before it first asks.
            seeds.give_back()
            validator.n_edges = 0
            return budget.exhausted()

        try:
            planner = og.RRTConnect(information)
            planner.setRange(longest_edge)
            setup.setPlanner(planner)
            setup.solve(ob.PlannerTerminationCondition(exhausted))
            return _solution(setup, problem.starts.shape[1])
        finally:
            information.setMotionValidator(_AnyMotion(information))


def ompl_can_search(problem: PlanningProblem) -> bool:
    """Say whether OMPL's RRT-Connect can solve a problem as ours does.

    It refuses starts out of bounds, adds up the distances of a compound space where we want the
    Euclidean one, and is given configurations as goals, all of them before it begins.
    """
    low, high = problem.system.bounds
    within = ((problem.starts >= low) & (problem.starts <= high)).all()
    return bool(within) and not problem.system.angular and problem.sampler is None


def _simple_setup(problem: PlanningProblem) -> Any:
    setup = og.SimpleSetup(_space(problem.system.bounds))
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


def _solution(setup: Any, dim: int) -> Array | None:
    # OMPL's status is true for approximate solutions as well.
    if not setup.haveExactSolutionPath():
        return None
    return np.array([state[0:dim] for state in setup.getSolutionPath().getStates()])


class _EdgeValidator(ob.MotionValidator):
    def __init__(
        self, information: Any, checker: EdgeChecker, dim: int, budget: Budget, n_free: int
    ) -> None:
        super().__init__(information)
        self._checker = checker
        self._dim = dim
        self._budget = budget
        self._n_free = n_free
        self.n_edges = 0

    def checkMotion(self, start: Any, end: Any) -> bool:  # noqa: N802
        self.n_edges += 1
        # OMPL connects its trees edge by edge and asks for no budget meanwhile.
        if self.n_edges > self._n_free and not self._budget.pay():
            return False
        edge = np.array([start[0 : self._dim], end[0 : self._dim]])
        return bool(self._checker.accept(edge[:1], edge[1:])[0])


class _AnyMotion(ob.MotionValidator):
    def checkMotion(self, start: Any, end: Any) -> bool:  # noqa: N802
        return True
