"""The planners that the car experiment compares, and what came of their plans."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.car.waypoints import move_waypoints
from planners import BiasedRRT, BiasedRRTConnect, PlanResult, best_of_restarts
from systems import Car, CarScene, Problem

PLANNERS = ("none", "classifier", "waypoints moved", "ours", "ceiling")
BETA = 0.3
ITERATIONS = 8000
# A plan that is less likely to succeed is made again, a few times.
ENOUGH = 0.6
MOST_PLANS = 4
# The most that a command may leave the car farther from its target than it was, in m and rad.
MOST_STRAYED = 0.3


class TrueCar(Car):
    """The car for a planner that may execute every transition: b is the true state and g is Γ.

    No classifier can do better than a planner for this system: its plans are executed as planned.
    """

    reduced_dim = 5

    def reduce(self, state: Any) -> np.ndarray:
        """Return the whole state."""
        return np.array(state, dtype=np.float64)

    def propagate(self, reduced: np.ndarray, command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Execute; there is no successor if the car hits something or strays from its target."""
        following, completed = self.execute(reduced, command)
        target = reduced[:, :3] + command
        left = self.distance(following[:, :3], target)
        length = np.linalg.norm(command, axis=1)
        # A planner first asks whether the car can stand still at the start: no way, no straying.
        return following, completed & ((left < length + MOST_STRAYED) | (length == 0))

    def steer(self, reduced: np.ndarray, configuration: np.ndarray) -> np.ndarray:
        """Steer as if the speed did not matter."""
        return super().steer(reduced[:, :3], configuration)

    def goal_reached(self, reduced: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """Compare poses."""
        return super().goal_reached(reduced[:, :3], goal)


def plan_query(
    name: str, scene: CarScene, classifier: Any, problem: Problem, seed: int
) -> PlanResult:
    """Plan with one of the planners of the comparison."""
    if name == "ceiling":
        planner = BiasedRRT(TrueCar(scene), simplify=False, random_state=seed)
        return planner.plan(problem.start, problem.goal)
    car = Car(scene)
    if name == "none":
        planner = BiasedRRTConnect(car, random_state=seed)
        return planner.plan(car.reduce(problem.start), problem.goal)
    if name == "classifier":
        return careful_planner(car, classifier, seed).plan(car.reduce(problem.start), problem.goal)
    if name == "waypoints moved":
        return careful_plan(car, classifier, problem, seed)
    return likely_plan(car, classifier, problem, seed)


def likely_plan(car: Car, classifier: Any, problem: Problem, seed: int) -> PlanResult:
    """Plan until a plan is likely enough to go well, and keep the likeliest."""
    return best_of_restarts(
        lambda i: careful_plan(car, classifier, problem, MOST_PLANS * seed + i),
        MOST_PLANS,
        enough=ENOUGH,
    )


def careful_plan(car: Car, classifier: Any, problem: Problem, seed: int) -> PlanResult:
    """Plan once, and move the waypoints to where the plan is more likely to go well."""
    plan = careful_planner(car, classifier, seed).plan(car.reduce(problem.start), problem.goal)
    return move_waypoints(car, classifier, plan, seed)


def careful_planner(car: Car, classifier: Any, seed: int | None = None) -> BiasedRRTConnect:
    """Build the planner that takes no Unreliable transition, and edges of one transition.

    A car can't drive straight towards most poses, so that long edges would hardly ever pass.
    """
    return BiasedRRTConnect(
        car,
        classifier,
        k=np.inf,
        transitions_per_edge=1,
        max_iterations=ITERATIONS,
        random_state=seed,
    )


def execute(scene: CarScene, problem: Problem, result: PlanResult) -> dict[str, float]:
    """Execute a plan; return how far from the goal it ended, and what it cost."""
    distance, hit = np.inf, False
    if result.success:
        car = Car(scene)
        rollout = car.rollout(problem.start, result.commands)
        hit = rollout.n_completed < len(result.commands)
        if not hit:
            distance = float(car.distance(rollout.states[-1:, :3], problem.goal)[0])
    return {
        "distance": distance,
        "solved": bool(result.success),
        "hit": hit,
        "milliseconds": 1e3 * (result.planning_time + result.simplification_time),
        "n_transitions": len(result.commands),
    }
