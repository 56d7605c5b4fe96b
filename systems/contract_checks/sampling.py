"""Checks of what a system draws: configurations and problems."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.contract_checks.calls import call, call_twice, check_array, check_zero_rows, fail
from systems.goal_region import GoalRegion
from systems.system import Array, Problem, System

N_GOALS = 16
# By how much a region's draws may miss it.
LARGEST_MISS = 1e-6


def check_samples(system: System, seed: int, n: int) -> None:
    """Check ``sample_configurations``."""
    samples = call(system, "sample_configurations", np.random.default_rng(seed), n)
    check_array(system, "sample_configurations", samples, (n, system.configuration_dim))
    _check_drawn_again(system, "sample_configurations", samples, seed, n)
    if not _within(samples, system.bounds).all():
        fail(system, "sample_configurations", f"left the bounds: {samples.tolist()}.")
    none = call(system, "sample_configurations", np.random.default_rng(seed), 0)
    check_zero_rows(system, "sample_configurations", none, (0, system.configuration_dim))


def check_problem(system: System, seed: int) -> Problem:
    """Check ``sample_problem``, and return the problem that it drew."""
    problem = call_twice(system, "sample_problem", seed)
    if not isinstance(problem, Problem):
        fail(system, "sample_problem", f"must return a Problem, got {problem!r}.")
    dim = system.configuration_dim
    if isinstance(problem.goal, GoalRegion):
        _check_region(system, problem.goal, seed)
        return problem
    if not _is_goal(problem.goal, dim):
        fail(
            system,
            "sample_problem",
            f"must return a goal that is an array of shape (n_goals, {dim}) or a GoalRegion, got "
            f"{problem.goal!r}.",
        )
    if not _within(problem.goal, system.bounds).all():
        fail(system, "sample_problem", f"returned a goal out of bounds: {problem.goal.tolist()}.")
    return problem


def check_ends(system: System, problem: Problem, start: Array, seed: int) -> None:
    """Check that planners will take a problem: g allows standing still at its start and a goal.

    Of goals it is only known where a reduced state is nothing but a configuration.
    """
    stays = "at which propagate is not valid, even for standing still, so that planners refuse it"
    remedy = "Draw again until it is, or correct propagate"
    if not can_stay(system, start[None])[0]:
        fail(
            system,
            "sample_problem",
            f"of random_state={seed} returned a start {stays}: {start}. {remedy}.",
        )
    goals = goals_of(system, problem, seed)
    if system.reduced_dim == system.configuration_dim and not can_stay(system, goals).any():
        fail(
            system,
            "sample_problem",
            f"of random_state={seed} returned goals {stays}, all {len(goals)}, such as {goals[0]}. "
            f"{remedy}.",
        )


def goals_of(system: System, problem: Problem, seed: int) -> Array:
    """Return a problem's goals, or those within bounds that are drawn from its region."""
    if not isinstance(problem.goal, GoalRegion):
        return problem.goal
    drawn = problem.goal.sample(np.random.default_rng(seed), N_GOALS)
    return drawn[_within(drawn, system.bounds)]


def can_stay(system: System, reduced: Array) -> NDArray[np.bool_]:
    """Say, for each reduced state, whether g allows standing still there."""
    command = call(system, "steer", reduced, reduced[:, : system.configuration_dim])
    valid: NDArray[np.bool_] = call(system, "propagate", reduced, command)[1]
    return valid


def draw_configurations(system: System, rng: np.random.Generator, n: int) -> Array:
    """Draw configurations, (n, configuration_dim), anywhere within the bounds."""
    low, high = system.bounds
    return rng.uniform(low, high, size=(n, system.configuration_dim))


def _check_region(system: System, region: GoalRegion, seed: int) -> None:
    drawn = call(region, "sample", np.random.default_rng(seed), N_GOALS)
    n = len(drawn) if isinstance(drawn, np.ndarray) and len(drawn) <= N_GOALS else N_GOALS
    check_array(region, "sample", drawn, (n, system.configuration_dim))
    _check_drawn_again(region, "sample", drawn, seed, N_GOALS)
    if not _within(drawn, system.bounds).any():
        fail(
            region,
            "sample",
            f"drew nothing within the system's bounds in {N_GOALS} draws: {drawn.tolist()}.",
        )
    distance = call_twice(region, "distance", drawn)
    check_array(region, "distance", distance, (n,))
    if (distance < 0).any() or (distance > LARGEST_MISS).any():
        fail(
            region,
            "distance",
            f"must be 0 for what sample drew, and positive outside; got {distance.tolist()}.",
        )


def _check_drawn_again(drawer: Any, method: str, drawn: Array, seed: int, n: int) -> None:
    """Demand that a generator with the same seed gives the same n draws again."""
    if not np.array_equal(drawn, call(drawer, method, np.random.default_rng(seed), n)):
        fail(
            drawer,
            method,
            "must draw from nothing but the given generator: the same generator gave two results.",
        )


def _is_goal(goal: Any, dim: int) -> bool:
    return isinstance(goal, np.ndarray) and goal.ndim == 2 and len(goal) > 0 and len(goal[0]) == dim


def _within(configurations: Array, bounds: Array) -> NDArray[np.bool_]:
    low, high = bounds
    within: NDArray[np.bool_] = ((configurations >= low) & (configurations <= high)).all(axis=1)
    return within
