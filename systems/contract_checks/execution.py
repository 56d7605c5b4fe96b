"""Checks of a system's true execution Γ and of its goals."""

from __future__ import annotations

from enum import Enum
from typing import Any

import numpy as np

from systems.contract_checks.calls import (
    call,
    call_twice,
    call_with_zero_rows,
    check_booleans,
    check_zero_rows,
    fail,
    same,
)
from systems.contract_checks.model import check_reduce
from systems.contract_checks.sampling import draw_configurations
from systems.goal_region import GoalRegion
from systems.system import Array, Problem, Rollout, StopReason, System

N_STEPS = 5
SMALLEST_TOLERANCE = 1e-12


def walk(system: System, problem: Problem, rng: np.random.Generator) -> Array:
    """Return commands, (T, command_dim), that g can follow from the start of a problem."""
    reduced = system.reduce(problem.start)[None]
    target = draw_configurations(system, rng, 1)
    commands = []
    for _ in range(N_STEPS):
        command = system.steer(reduced, target)
        reduced, valid = system.propagate(reduced, command)
        if not valid[0]:
            break
        commands.append(command[0])
    return np.reshape(commands, (len(commands), -1)) if commands else command[:0]


def check_rollout(system: System, start: Any, commands: Array) -> Rollout:
    """Check ``rollout``, of some commands and of none, and return what it returned."""
    rollout = call_twice(system, "rollout", start, commands)
    _check_type(system, rollout)
    _check_counts(system, rollout, len(commands))
    if not same(system.reduce(rollout.states[0]), system.reduce(start)):
        fail(system, "rollout", "must return the start state first.")
    for state in rollout.states:
        check_reduce(system, state)
    nothing = call(system, "rollout", start, commands[:0])
    if nothing.n_completed != 0 or len(nothing.states) != 1:
        fail(system, "rollout", "of no commands must return the start state alone.")
    return rollout


def _check_type(system: System, rollout: Any) -> None:
    if not isinstance(rollout, Rollout):
        fail(system, "rollout", f"must return a Rollout, got {rollout!r}.")
    reason = rollout.stop_reason
    if not isinstance(reason, Enum) or not isinstance(reason.value, str):
        fail(
            system,
            "rollout",
            "must return a stop_reason that is a StopReason, or a member of an enum of your own "
            f"whose value is a sentence, got {reason!r}.",
        )


def _check_counts(system: System, rollout: Rollout, n_commands: int) -> None:
    completed = rollout.stop_reason is StopReason.COMPLETED
    if completed != (rollout.n_completed == n_commands):
        fail(
            system,
            "rollout",
            f"completed {rollout.n_completed} of {n_commands} commands, which does not agree with "
            f"the stop reason {rollout.stop_reason.name}: it must be COMPLETED if, and only if, "
            "every command was carried out.",
        )
    expected = rollout.n_completed + (1 if completed else 2)
    if len(rollout.states) != expected:
        fail(
            system,
            "rollout",
            "must return the start, one state per completed command and, if it stopped, the state "
            f"at the boundary: {expected} states, got {len(rollout.states)}.",
        )


def check_goals(system: System, problem: Problem, goals: Array, executed: Rollout) -> None:
    """Check ``goal_reached`` and ``succeeded`` on the states of an execution.

    Where the goal is a region, ``goals`` are drawn from it, and ``succeeded`` is never asked.
    """
    reduced = np.array([system.reduce(state) for state in executed.states])
    reached = call_twice(system, "goal_reached", reduced, goals)
    check_booleans(system, "goal_reached", reached, len(reduced))
    none = call_with_zero_rows(system, "goal_reached", reduced, rest=(goals,))
    check_zero_rows(system, "goal_reached", none, (0,))
    if not isinstance(problem.goal, GoalRegion):
        _check_success(system, problem, executed.states[-1])


def _check_success(system: System, problem: Problem, last: Any) -> None:
    for tolerance in (SMALLEST_TOLERANCE, np.inf):
        succeeded = call_twice(system, "succeeded", last, problem.goal, tolerance)
        if not isinstance(succeeded, bool | np.bool_):
            fail(system, "succeeded", f"must return a bool, got {succeeded!r}.")
    if not succeeded:
        fail(system, "succeeded", "says False at an infinite tolerance.")
