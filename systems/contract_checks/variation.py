"""Checks that a system's answers vary: methods that always say the same are of no use.

Each names how often it tried, since a few trials can't tell "never" from "seldom". A trial that
came out otherwise ends the search.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from systems.angles import shortest_way
from systems.contract_checks.calls import call, fail, same
from systems.contract_checks.execution import walk
from systems.contract_checks.sampling import can_stay, draw_configurations
from systems.system import Array, Problem, System

N_BATCHES = 16
N_WALK_STEPS = 40
N_CONFIGURATIONS = 32


def draw_moves(
    system: System, starts: Array, rng: np.random.Generator, n: int
) -> tuple[Array, Array]:
    """Draw n states among starts, and n targets, of which g can make at least one step to some.

    Returns
    -------
    reduced : ndarray of shape (n, reduced_dim)
    targets : ndarray of shape (n, configuration_dim)
    """
    n_valid = 0
    for _ in range(N_BATCHES):
        reduced = starts[rng.integers(len(starts), size=n)]
        targets = draw_configurations(system, rng, n)
        valid, moved = _moves(system, reduced, targets)
        n_valid += int(valid.sum())
        if moved.any():
            break
    else:
        fail(system, "propagate", _no_moves(n_valid, N_BATCHES * n))
    return reduced, targets


def _no_moves(n_valid: int, n_trials: int) -> str:
    if n_valid:
        return (
            f"moved the configuration in none of {n_valid} valid transitions towards random "
            "configurations, so that no plan can get anywhere. next_reduced must be where the "
            "command leads, and steer must command a motion."
        )
    return (
        f"was valid for none of {n_trials} transitions from the starts of sample_problem towards "
        "random configurations, so that no plan can be made. valid must be True wherever g has a "
        "successor; are the starts in an obstacle?"
    )


def wander(system: System, starts: Array, rng: np.random.Generator) -> Array:
    """Return many reduced states: starts, and where g leads from them.

    Also configurations at which g allows standing still, if that is all that reduced states are.
    """
    reduced, targets = starts, draw_configurations(system, rng, len(starts))
    for _ in range(N_WALK_STEPS):
        command = call(system, "steer", reduced, targets)
        following, valid = call(system, "propagate", reduced, command)
        reduced = np.where(valid[:, None], following, reduced)
    states = np.concatenate([starts, reduced])
    if system.reduced_dim > system.configuration_dim:
        return states
    drawn = draw_configurations(system, rng, N_CONFIGURATIONS)
    return np.concatenate([states, drawn[can_stay(system, drawn)]])


def check_close_varies(system: System, states: Array) -> None:
    """Check that ``close`` says False of some two reduced states."""
    one, other = _different_pairs(states)
    if len(one) and call(system, "close", one, other).all():
        dim = system.configuration_dim
        apart = np.linalg.norm(shortest_way(one[:, :dim], other[:, :dim], system.angular), axis=1)
        fail(
            system,
            "close",
            f"says True in all {len(one)} trials with different reduced states, of which the "
            f"configurations are up to {apart.max():.3g} apart (step_size is "
            f"{system.step_size:.3g}). Then every transition is Reliable and there is nothing to "
            "learn; it must be False where a plan could not go on as planned.",
        )


def check_goal_reached_varies(system: System, goals: list[Array], states: Array) -> None:
    """Check that ``goal_reached`` says False of some state, and True of the goals themselves."""
    if all(call(system, "goal_reached", states, goal).all() for goal in goals):
        fail(
            system,
            "goal_reached",
            f"says True in all {len(goals) * len(states)} trials, also of the starts of "
            f"{len(goals)} problems. Then every plan is empty; it must be True only at the goal.",
        )
    if system.reduced_dim > system.configuration_dim:
        return
    for goal in goals:
        reached = call(system, "goal_reached", goal, goal)
        if not reached.all():
            fail(
                system,
                "goal_reached",
                f"says False of the goal itself, {goal[~reached][0]}. Then no plan arrives; allow "
                "for rounding, such as a distance of 1e-6.",
            )


def check_commands_matter(
    system: System, problems: list[Problem], rng: np.random.Generator
) -> None:
    """Check that ``rollout`` of other commands ends elsewhere."""
    n_trials = 0
    for problem in problems:
        one, other = (walk(system, problem, rng) for _ in range(2))
        n = min(len(one), len(other))
        if n == 0 or np.array_equal(one[:n], other[:n]):
            continue
        rollouts = [call(system, "rollout", problem.start, each[:n]) for each in (one, other)]
        if not same(*(system.reduce(rollout.states[-1]) for rollout in rollouts)):
            return
        # A system that stops at once is stopped whatever it is told.
        n_trials += all(rollout.n_completed > 0 for rollout in rollouts)
    if n_trials:
        fail(
            system,
            "rollout",
            f"ended in the same state for two different sequences of commands, in all {n_trials} "
            "trials. It must carry out the commands that it is given.",
        )


def _moves(
    system: System, reduced: Array, targets: Array
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which steps towards targets g allows, and which of those move the configuration."""
    command = call(system, "steer", reduced, targets)
    following, valid = call(system, "propagate", reduced, command)
    dim, moved = system.configuration_dim, np.array(valid)
    moved[valid] = (following[valid, :dim] != reduced[valid, :dim]).any(axis=1)
    return valid, moved


def _different_pairs(states: Array) -> tuple[Array, Array]:
    pairs = np.array(list(combinations(range(len(states)), 2)))
    one, other = states[pairs[:, 0]], states[pairs[:, 1]]
    different = (one != other).any(axis=1)
    return one[different], other[different]
