"""What the car costs: Γ per second, planning with and without the classifier, and batches.

All ratios are of times taken side by side in one run, on one core. Needs the model that
`make car` leaves in build/car.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from planners import BiasedRRTConnect, PlanResult
from reliability import load_estimator
from systems import Car, Problem, random_car_scene

SCENE_SEED, QUERY_SEED, TARGET_SEED = 51, 52, 53
N_STARTS, N_TIMES = 400, 25
TARGETS_AROUND = np.array([0.7, 0.7, 0.7])


class OneByOne(Car):
    """The car whose model and features are called for one transition at a time."""

    def propagate(
        self, reduced: NDArray[np.float64], command: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Call g for each row by itself."""
        if len(reduced) < 2:
            return super().propagate(reduced, command)
        parts = [super(OneByOne, self).propagate(*rows) for rows in _rows(reduced, command)]
        following, valid = zip(*parts, strict=True)
        return np.concatenate(following), np.concatenate(valid)

    def features(
        self, reduced: NDArray[np.float64], next_reduced: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Describe each row by itself."""
        if len(reduced) < 2:
            return super().features(reduced, next_reduced)
        parts = [super(OneByOne, self).features(*rows) for rows in _rows(reduced, next_reduced)]
        return np.concatenate(parts)


class OneCallPerTransition:
    """An estimator that is asked about one transition at a time, through ``predict``."""

    def __init__(self, estimator: Any) -> None:
        self._estimator = estimator
        self.classes_ = estimator.classes_
        self.validation_accuracy_ = estimator.validation_accuracy_

    def predict(self, X: NDArray[np.float64]) -> NDArray[Any]:
        """Ask the estimator about each row by itself."""
        return np.concatenate([self._estimator.predict(X[i : i + 1]) for i in range(len(X))])

    def predict_proba(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Ask the estimator about each row by itself."""
        return np.concatenate([self._estimator.predict_proba(X[i : i + 1]) for i in range(len(X))])


def main() -> None:
    """Print rates and ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", type=Path, default=Path("build/car/car.joblib"))
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--queries", type=int, default=10, help="queries per scene")
    options = parser.parse_args()
    model = load_estimator(options.model)
    cars = [
        Car(random_car_scene(np.random.SeedSequence([SCENE_SEED, i])))
        for i in range(options.scenes)
    ]
    queries = [(car, problem) for car in cars for problem in _problems(car, options.queries)]
    with threadpool_limits(1):
        time_execution(cars)
        compare_planning(queries, model)
        compare_batches(queries[:: max(1, options.queries // 2)], model)


def time_execution(cars: list[Car]) -> None:
    """Time Γ for many transitions at once, and by a call for each."""
    rng = np.random.default_rng(TARGET_SEED)
    rows = [_transitions(car, rng) for car in cars]
    n = sum(len(states) for states, _ in rows)
    for car, (states, commands) in zip(cars, rows, strict=True):
        car.execute(states, commands)
    began = time.perf_counter()
    for _ in range(N_TIMES):
        for car, (states, commands) in zip(cars, rows, strict=True):
            car.execute(states, commands)
    batch = (time.perf_counter() - began) / (N_TIMES * n)
    began = time.perf_counter()
    for car, (states, commands) in zip(cars, rows, strict=True):
        for i in range(len(states)):
            car.rollout(states[i], commands[i : i + 1])
    single = (time.perf_counter() - began) / n
    print(
        f"Γ: {1 / batch:,.0f} transitions/s and core in batches, {1 / single:,.0f} with a call of "
        f"rollout for each: {single / batch:.1f} times"
    )


def compare_planning(queries: list[tuple[Car, Problem]], model: Any) -> None:
    """Time planning with and without the classifier on the same queries, in turn."""
    without, with_model = [], []
    for seed, (car, problem) in enumerate(queries):
        without.append(_plan(car, None, problem, seed))
        with_model.append(_plan(car, model, problem, seed))
    medians = [1e3 * np.median([_total(plan) for plan in plans]) for plans in (without, with_model)]
    tail = 1e3 * np.percentile([_total(plan) for plan in with_model], 95)
    print(
        f"plan and simplify, median of {len(queries)}: {medians[0]:.2f} ms without, "
        f"{medians[1]:.1f} ms with the classifier ({tail:.0f} ms for 19 of 20): "
        f"{medians[1] / medians[0]:.0f} times"
    )
    checked = sum(plan.n_checked for plan in with_model)
    spent = sum(_total(plan) for plan in with_model)
    print(
        f"per classified transition: {1e6 * spent / checked:.1f} µs for all of planning "
        f"({checked / len(queries):.0f} transitions a plan)"
    )


def compare_batches(queries: list[tuple[Car, Problem]], model: Any) -> None:
    """Time the same plans with our batches, and with a call for each transition."""
    times = {"batched": 0.0, "singly": 0.0}
    for seed, (car, problem) in enumerate(queries):
        batched = _plan(car, model, problem, seed)
        singly = _plan(OneByOne(car.scene), OneCallPerTransition(model), problem, seed)
        if not np.array_equal(batched.reduced, singly.reduced):
            raise RuntimeError(f"Query {seed} gave two plans; only equal work can be compared.")
        times["batched"] += _total(batched)
        times["singly"] += _total(singly)
    print(
        f"the same {len(queries)} plans with a call of g, features and predict for each "
        f"transition take {times['singly'] / times['batched']:.1f} times as long as in batches"
    )


def _transitions(car: Car, rng: np.random.Generator) -> tuple[NDArray[Any], NDArray[Any]]:
    """Draw moving states and displacements that g allows."""
    low, high = car.bounds
    poses = rng.uniform(low, high, size=(N_STARTS, 3))
    commands = rng.uniform(-TARGETS_AROUND, TARGETS_AROUND, size=(N_STARTS, 3))
    allowed = (car.clearance(poses) > 0.01) & car.propagate(poses, commands)[1]
    speeds = rng.uniform(-0.5, 0.5, size=(N_STARTS, 1))
    states = np.hstack([poses, speeds, np.zeros((N_STARTS, 1))])
    return states[allowed], commands[allowed]


def _problems(car: Car, n: int) -> list[Problem]:
    return [car.sample_problem(np.random.SeedSequence([QUERY_SEED, i])) for i in range(n)]


def _plan(car: Car, estimator: Any, problem: Problem, seed: int) -> PlanResult:
    k = {"k": np.inf, "transitions_per_edge": 1} if estimator is not None else {}
    planner = BiasedRRTConnect(car, estimator, random_state=seed, **k)
    return planner.plan(car.reduce(problem.start), problem.goal)


def _rows(*arrays: NDArray[Any]) -> list[tuple[NDArray[Any], ...]]:
    return [tuple(array[i : i + 1] for array in arrays) for i in range(len(arrays[0]))]


def _total(plan: PlanResult) -> float:
    return plan.planning_time + plan.simplification_time


if __name__ == "__main__":
    main()
