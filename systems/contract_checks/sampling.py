"""Checks of what a system draws: configurations and problems."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.contract_checks.calls import call, call_twice, check_array, fail
from systems.system import Array, Problem, System


def check_samples(system: System, seed: int, n: int) -> None:
    """Check ``sample_configurations``."""
    samples, again = (
        call(system, "sample_configurations", np.random.default_rng(seed), n) for _ in range(2)
    )
    check_array(system, "sample_configurations", samples, (n, system.configuration_dim))
    if not np.array_equal(samples, again):
        fail(
            system,
            "sample_configurations",
            "must draw from nothing but the given generator: the same generator gave two results.",
        )
    if not _within(samples, system.bounds):
        fail(system, "sample_configurations", f"left the bounds: {samples.tolist()}.")


def check_problem(system: System, seed: int) -> Problem:
    """Check ``sample_problem``, and return the problem that it drew."""
    problem = call_twice(system, "sample_problem", seed)
    if not isinstance(problem, Problem):
        fail(system, "sample_problem", f"must return a Problem, got {problem!r}.")
    dim = system.configuration_dim
    if not _is_goal(problem.goal, dim):
        fail(
            system,
            "sample_problem",
            f"must return a goal that is an array of shape (n_goals, {dim}), got {problem.goal!r}.",
        )
    if not _within(problem.goal, system.bounds):
        fail(system, "sample_problem", f"returned a goal out of bounds: {problem.goal.tolist()}.")
    return problem


def draw_configurations(system: System, rng: np.random.Generator, n: int) -> Array:
    """Draw configurations, (n, configuration_dim), anywhere within the bounds."""
    low, high = system.bounds
    return rng.uniform(low, high, size=(n, system.configuration_dim))


def _is_goal(goal: Any, dim: int) -> bool:
    return isinstance(goal, np.ndarray) and goal.ndim == 2 and len(goal) > 0 and len(goal[0]) == dim


def _within(configurations: Array, bounds: Array) -> bool:
    low, high = bounds
    return bool(((configurations >= low) & (configurations <= high)).all())
