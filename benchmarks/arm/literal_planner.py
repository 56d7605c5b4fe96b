"""RRT-Connect with a classifier as the paper's text has it, for comparison."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from planners import CheckTransition, EdgeChecker, split_edges
from systems import System

MAX_ITERATIONS = 20_000
SIMPLIFICATION_LIMIT = 1.0


@dataclass(frozen=True)
class LiteralResult:
    """The part of a plan's result that the experiment reads."""

    commands: np.ndarray
    success: bool
    planning_time: float
    simplification_time: float
    n_checked: int


@dataclass(frozen=True)
class LiteralPlanner:
    """OMPL's defaults with Algorithm 1 as motion validator.

    All goals are given to RRT-Connect, and its range is OMPL's default of a fifth of the space.
    simplifyMax asks the same motion validator, which accepts Unreliable transitions at random, and
    asks about edges in either direction. Search and simplification are bounded, because neither
    has to come to an end by itself.

    Parameters
    ----------
    system : System
    estimator : estimator
    k, accuracy : float
    random_state : int
    """

    system: System
    estimator: Any
    k: float
    accuracy: float
    random_state: int

    def plan(self, start: np.ndarray, goal: np.ndarray) -> LiteralResult:
        """Plan from ``start`` to any row of ``goal``."""
        rng = np.random.default_rng(self.random_state)
        check = CheckTransition(
            self.system, self.estimator, k=self.k, accuracy=self.accuracy, rng=rng
        )
        began = time.perf_counter()
        ou.setLogLevel(ou.LOG_NONE)
        ou.RNG.setSeed(self.random_state + 1)
        setup = _problem(self.system, start, goal)
        information = setup.getSpaceInformation()
        information.setMotionValidator(_Validator(information, EdgeChecker(self.system, check)))
        try:
            vertices, planned = _solve(setup, start)
        finally:
            information.setMotionValidator(_Anything(information))
        origins, targets, _ = split_edges(vertices[:-1], vertices[1:], self.system.step_size)
        return LiteralResult(
            commands=self.system.steer(origins, targets),
            success=len(vertices) > 1,
            planning_time=planned - began,
            simplification_time=time.perf_counter() - planned,
            n_checked=check.n_checked,
        )


def _solve(setup: Any, start: np.ndarray) -> tuple[np.ndarray, float]:
    iterations = iter(range(MAX_ITERATIONS))
    setup.solve(ob.PlannerTerminationCondition(lambda: next(iterations, None) is None))
    planned = time.perf_counter()
    if not setup.haveExactSolutionPath():
        return start[None], planned
    path = setup.getSolutionPath()
    og.PathSimplifier(setup.getSpaceInformation()).simplify(path, SIMPLIFICATION_LIMIT)
    return np.array([state[0:3] for state in path.getStates()]), planned


def _problem(system: System, start: np.ndarray, goal: np.ndarray) -> Any:
    space = ob.RealVectorStateSpace(3)
    limits = ob.RealVectorBounds(3)
    limits.setLow(float(system.bounds[0, 0]))
    limits.setHigh(float(system.bounds[1, 0]))
    space.setBounds(limits)
    setup = og.SimpleSetup(space)
    information = setup.getSpaceInformation()
    setup.setStateValidityChecker(lambda state: True)
    setup.addStartState(_state(information, start))
    goals = ob.GoalStates(information)
    for configuration in goal:
        goals.addState(_state(information, configuration))
    setup.setGoal(goals)
    setup.setPlanner(og.RRTConnect(information))
    return setup


def _state(information: Any, configuration: np.ndarray) -> Any:
    state = information.allocState()
    state[0:3] = configuration.tolist()
    return state


class _Validator(ob.MotionValidator):
    def __init__(self, information: Any, checker: EdgeChecker) -> None:
        super().__init__(information)
        self._checker = checker

    def checkMotion(self, start: Any, end: Any) -> bool:  # noqa: N802
        edge = np.array([start[0:3], end[0:3]])
        return bool(self._checker.accept(edge[:1], edge[1:])[0])


class _Anything(ob.MotionValidator):
    def checkMotion(self, start: Any, end: Any) -> bool:  # noqa: N802
        return True
