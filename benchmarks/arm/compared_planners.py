"""The planners that the arm experiment compares."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.arm.literal_planner import LiteralPlanner
from planners import BiasedRRTConnect, PlanResult, best_of_restarts
from systems import PlanarArm, Problem

PLANNERS = ("none", "none, holdable goals", "literal", "ours")
LITERAL_ACCURACY = 0.99


class RawFeatureArm(PlanarArm):
    """The arm with the paper's input to the classifier, b and b'."""

    def features(self, reduced: np.ndarray, next_reduced: np.ndarray) -> np.ndarray:
        """Return (n, 6) rows of two configurations."""
        return np.hstack([reduced, next_reduced])


class HoldableGoals:
    """Plans without a classifier, but only for goals that the arm can hold.

    Tells choosing the goal apart from choosing the way.
    """

    def __init__(self, arm: PlanarArm, seed: int) -> None:
        self._arm = arm
        self._planner = BiasedRRTConnect(arm, random_state=seed)

    def plan(self, start: np.ndarray, goal: np.ndarray) -> PlanResult:
        """Plan to the rows of ``goal`` that can be held."""
        return self._planner.plan(start, goal[self._arm.can_hold(goal)])


def make_planner(name: str, arm: PlanarArm, classifiers: dict[str, Any], seed: int) -> Any:
    """Build one of the planners by its name in the tables."""
    if name == "none":
        return BiasedRRTConnect(arm, random_state=seed)
    if name == "none, holdable goals":
        return HoldableGoals(arm, seed)
    if name == "literal":
        return LiteralPlanner(
            RawFeatureArm(),
            classifiers["literal"],
            k=1.0,
            accuracy=LITERAL_ACCURACY,
            random_state=seed,
        )
    return BiasedRRTConnect(arm, classifiers["ours"], random_state=seed)


def most_reliable_plan(
    arm: PlanarArm,
    classifiers: dict[str, Any],
    start: np.ndarray,
    goal: np.ndarray,
    seed: int,
    n_plans: int,
) -> PlanResult:
    """Plan several times and keep the plan whose last transition is the most reliable.

    A transition is Reliable if the execution is where the plan says, so that of the last one is
    the probability that the plan arrives.
    """
    return best_of_restarts(
        lambda i: make_planner("ours", arm, classifiers, n_plans * seed + i).plan(start, goal),
        n_plans,
        score=lambda plan: float(plan.reliability[-1]),
    )


def execute(arm: PlanarArm, problem: Problem, result: Any) -> dict[str, float]:
    """Execute a plan; return how far from the goal it ended, and what it cost."""
    distance = np.inf
    if result.success:
        final = arm.rollout(problem.start, result.commands).states[-1]
        distance = float(np.linalg.norm(problem.goal - final, axis=1).min())
    return {
        "distance": distance,
        "solved": bool(result.success),
        "planning": result.planning_time,
        "simplification": result.simplification_time,
        "n_checked": result.n_checked,
    }
