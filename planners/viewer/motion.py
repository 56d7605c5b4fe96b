"""The planned and the executed motion of one plan, transition by transition."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from planners.execution import Execution
from planners.result import PlanResult
from planners.viewer.drawn_system import DrawnSystem
from planners.viewer.interpolation import shapes_at
from systems.drawing.shapes import Shape
from systems.system import Array, Rollout, System

Moments = list[list[Shape]]


@dataclass(frozen=True, eq=False)
class Story:
    """What was planned and what came of it, as arrays.

    Attributes
    ----------
    plans : list of PlanResult
        Those that were followed, one after the other; or the one that was not found.
    transitions : ndarray of shape (n, 2, reduced_dim)
        Planned reduced states at the ends of each transition. Where a plan was replaced by
        another, only those before are here.
    states : list of states
        True states, the start first; none without an execution.
    commands : ndarray of shape (len(states) - 1, command_dim)
    diverged_at : int or None
        The number of the first transition after which the true state was not Close to the plan.
    """

    plans: list[PlanResult]
    transitions: Array
    states: list[Any]
    commands: Array
    diverged_at: int | None

    @property
    def n_transitions(self) -> int:
        """How many transitions the longer of both motions has."""
        return max(len(self.transitions), len(self.states) - 1)


def story_of(system: System, plan: PlanResult | Execution, rollout: Rollout | None) -> Story:
    """Bring a plan and its rollout, or an execution with all its plans, into one form."""
    if isinstance(plan, Execution):
        chosen = [
            (start, made)
            for start, made in zip(plan.plan_starts, plan.plans, strict=True)
            if made.success and len(made.commands)
        ]
        chosen = chosen or [(0, plan.plans[0])]
        states, commands = plan.states, plan.commands
    else:
        chosen = [(0, plan)]
        states = [] if rollout is None else list(rollout.states)
        commands = plan.commands[: max(len(states) - 1, 0)]
    transitions = _followed(chosen)
    diverged_at = _first_not_close(system, transitions, states)
    return Story([made for _, made in chosen], transitions, states, commands, diverged_at)


def _followed(chosen: Sequence[tuple[int, PlanResult]]) -> Array:
    ends = [start for start, _ in chosen[1:]] + [None]
    parts = [
        np.stack([plan.reduced[:-1], plan.reduced[1:]], axis=1)[
            : None if end is None else end - start
        ]
        for (start, plan), end in zip(chosen, ends, strict=True)
    ]
    return np.concatenate(parts)


def _first_not_close(system: System, transitions: Array, states: Sequence[Any]) -> int | None:
    n = min(len(transitions), len(states) - 1)
    if n < 1:
        return None
    executed = np.array([system.reduce(state) for state in states[1 : n + 1]])
    apart = np.flatnonzero(~system.close(transitions[:n, 1], executed))
    return int(apart[0]) if len(apart) else None


def planned_moments(drawn: DrawnSystem, story: Story) -> list[Moments]:
    """Return, for each transition, the shapes at its begin and its end."""
    return [[drawn.reduced(before), drawn.reduced(after)] for before, after in story.transitions]


def executed_states(system: System, story: Story) -> list[list[Any]]:
    """Return, for each command, the states that are known from its begin to its end."""
    between = [
        list(system.states_between(state, command))[1:-1]
        for state, command in zip(story.states, story.commands, strict=False)
    ]
    return [[story.states[i], *inner, story.states[i + 1]] for i, inner in enumerate(between)]


def frames(moments: list[Moments], n_transitions: int, per_transition: int) -> list[list[Shape]]:
    """Return the shapes in each of ``n_transitions * per_transition + 1`` frames.

    A motion with fewer transitions stays where it ends; without moments there are no frames.
    """
    if not moments:
        return []
    shown = []
    for frame in range(n_transitions * per_transition + 1):
        number, rest = divmod(frame, per_transition)
        if number < len(moments):
            shown.append(shapes_at(moments[number], rest / per_transition))
        else:
            shown.append(list(moments[-1][-1]))
    return shown
