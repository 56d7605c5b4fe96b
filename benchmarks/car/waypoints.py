"""Waypoints of a car's plan, moved to where the plan is more likely to go well."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from planners import PlanResult
from systems import Car, shortest_way, wrap_columns

ROUNDS = 20
# Metres and radians; each is tried twice.
SPREADS = np.repeat([0.02, 0.05, 0.1, 0.2], 2)


def move_waypoints(car: Car, classifier: Any, plan: PlanResult, seed: int) -> PlanResult:
    """Move waypoints at random, and keep what makes the plan more likely to go well.

    An RRT takes the first transitions that pass, often within centimetres of an obstacle, and
    whether the car then touches it is up to the errors that it comes with. Every transition stays
    one that g allows and that is classified Reliable.
    """
    if not plan.success or len(plan.commands) < 2:
        return plan
    began = time.perf_counter()
    rng = np.random.default_rng(seed)
    path = plan.reduced.copy()
    negative_log_likelihood = negative_log_likelihoods(car, classifier, path[:-1], path[1:])
    for number in range(ROUNDS):
        # While a waypoint moves, its neighbours stand still.
        moving = np.arange(1 + number % 2, len(negative_log_likelihood), 2)
        _move(car, classifier, path, negative_log_likelihood, moving, rng)
    return replace(
        plan,
        reduced=path,
        commands=car.steer(path[:-1], path[1:]),
        reliability=np.exp(-negative_log_likelihood),
        simplification_time=plan.simplification_time + time.perf_counter() - began,
    )


def _move(
    car: Car,
    classifier: Any,
    path: np.ndarray,
    negative_log_likelihood: np.ndarray,
    moving: np.ndarray,
    rng: np.random.Generator,
) -> None:
    """Move some waypoints of ``path`` in place, each to the best of a few proposals if any."""
    shape = (len(moving), len(SPREADS), 3)
    proposed = path[moving][:, None] + SPREADS[:, None] * rng.normal(size=shape)
    middle = wrap_columns(proposed.reshape(-1, 3), car.angular)
    before, after = (np.repeat(path[moving + i], len(SPREADS), axis=0) for i in (-1, 1))
    both = negative_log_likelihoods(
        car, classifier, np.concatenate([before, middle]), np.concatenate([middle, after])
    ).reshape(2, *shape[:2])
    best = both.sum(axis=0).argmin(axis=1)
    rows = np.arange(len(moving))
    first, second = both[:, rows, best]
    better = first + second < negative_log_likelihood[moving - 1] + negative_log_likelihood[moving]
    at = moving[better]
    path[at] = middle.reshape(shape)[rows, best][better]
    negative_log_likelihood[at - 1], negative_log_likelihood[at] = first[better], second[better]


def negative_log_likelihoods(
    car: Car, classifier: Any, reduced: np.ndarray, next_reduced: np.ndarray
) -> np.ndarray:
    """Return -log of the probability that each transition is Reliable; infinite if forbidden."""
    commands = shortest_way(reduced, next_reduced, car.angular)
    short = np.linalg.norm(commands, axis=1) <= car.step_size * (1 + 1e-9)
    possible = np.flatnonzero(short)
    possible = possible[car.propagate(reduced[possible], commands[possible])[1]]
    negative_log_likelihood = np.full(len(reduced), np.inf)
    if len(possible):
        rows = car.features(reduced[possible], next_reduced[possible])
        logits = classifier.decision_function(rows).astype(np.float64)
        negative_log_likelihood[possible] = np.where(logits > 0, np.logaddexp(0, -logits), np.inf)
    return negative_log_likelihood
