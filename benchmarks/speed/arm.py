"""What classification costs inside the planners: ratios, measured side by side in one run.

Needs the model and the data that `make arm` leaves in build/arm.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.ensemble import RandomForestClassifier
from threadpoolctl import threadpool_limits

from planners import BiasedRRTConnect, PlanResult
from reliability import Transitions, load_estimator
from systems import PlanarArm, Problem

QUERY_SEED = 7


class OneCallPerTransition:
    """Any estimator, asked about one transition at a time by OMPL's own RRT-Connect."""

    def __init__(self, estimator: Any) -> None:
        self._estimator = estimator
        self.classes_ = estimator.classes_

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Ask the estimator about each row by itself."""
        return np.concatenate([self._estimator.predict(X[i : i + 1]) for i in range(len(X))])

    def fast_decision_function(self, X: np.ndarray) -> np.ndarray:
        """Claim to be fast, so that the sequential search is chosen."""
        return np.where(self.predict(X) == self.classes_[1], 1e3, -1e3)


def main() -> None:
    """Print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("build/arm"))
    parser.add_argument("--queries", type=int, default=200)
    options = parser.parse_args()
    arm = PlanarArm()
    model = load_estimator(options.folder / "arm.joblib")
    with threadpool_limits(1):
        compare_single_transitions(arm, model)
        compare_planning(arm, model, options.queries)
        compare_batches(arm, options)


def compare_single_transitions(arm: PlanarArm, model: Any) -> None:
    """Time one transition through predict and through the planners' fast path."""
    rows = arm.features(np.zeros((1, 3)), np.full((1, 3), 0.05))
    slow = seconds_per_call(lambda: model.predict(rows), 2000)
    fast = seconds_per_call(lambda: model.fast_decision_function(rows), 20000)
    print(
        f"one transition: predict {1e6 * slow:.0f} µs, fast path {1e6 * fast:.1f} µs: "
        f"{slow / fast:.0f} times faster"
    )


def compare_planning(arm: PlanarArm, model: Any, n_queries: int) -> None:
    """Time planning with and without the classifier on the same queries, in turn."""
    problems = queries(arm, n_queries)
    without, with_model = [], []
    for seed, problem in enumerate(problems):
        without.append(solve(arm, None, problem, seed))
        with_model.append(solve(arm, model, problem, seed))
    medians = [1e3 * np.median([total(plan) for plan in plans]) for plans in (without, with_model)]
    print(
        f"plan and simplify, median of {n_queries}: {medians[0]:.2f} ms without, "
        f"{medians[1]:.2f} ms with the classifier: {medians[1] / medians[0]:.1f} times"
    )
    checked = sum(plan.n_checked for plan in with_model)
    spent, unbiased = (sum(total(plan) for plan in plans) for plans in (with_model, without))
    print(
        f"per classified transition: {1e6 * spent / checked:.2f} µs for all of planning, "
        f"{1e6 * (spent - unbiased) / checked:.2f} µs more than planning without "
        f"({checked / n_queries:.0f} transitions a plan)"
    )


def compare_batches(arm: PlanarArm, options: argparse.Namespace) -> None:
    """Time a forest asked about many extensions at once, and about one transition at a time."""
    transitions = Transitions.load(options.folder / "transitions.npz")[::20]
    forest = RandomForestClassifier(50, max_depth=12, random_state=0)
    forest.fit(transitions.features(arm), transitions.y)
    problems = queries(arm, 8)
    times = {}
    for name, estimator in (("batched", forest), ("singly", OneCallPerTransition(forest))):
        plans = [solve(arm, estimator, problem, i, k=2.0) for i, problem in enumerate(problems)]
        checked = sum(plan.n_checked for plan in plans)
        times[name] = sum(total(plan) for plan in plans) / checked
    print(
        f"random forest, per classified transition: {1e6 * times['batched']:.0f} µs in batches, "
        f"{1e6 * times['singly']:.0f} µs one by one: {times['singly'] / times['batched']:.0f} "
        "times faster"
    )


def queries(arm: PlanarArm, n: int) -> list[Problem]:
    """Draw queries that are used for nothing else."""
    return [arm.sample_reaching_problem(np.random.SeedSequence([QUERY_SEED, i])) for i in range(n)]


def solve(
    arm: PlanarArm, estimator: Any, problem: Problem, seed: int, k: float = 1.0
) -> PlanResult:
    """Plan once."""
    planner = BiasedRRTConnect(arm, estimator, k=k, accuracy=0.98, random_state=seed)
    return planner.plan(problem.start, problem.goal)


def total(plan: PlanResult) -> float:
    """Return the seconds that a plan took."""
    return plan.planning_time + plan.simplification_time


def seconds_per_call(call: Callable[[], object], n_calls: int) -> float:
    """Time many calls after a first one that compiles."""
    call()
    began = time.perf_counter()
    for _ in range(n_calls):
        call()
    return (time.perf_counter() - began) / n_calls


if __name__ == "__main__":
    main()
