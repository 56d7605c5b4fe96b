"""All that is drawn of one plan, as plain data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from planners.execution import Execution
from planners.result import PlanResult
from planners.viewer.colors import EXECUTED, NOT_ESTIMATED, reliability_colors
from planners.viewer.drawn_system import DrawnSystem
from planners.viewer.motion import (
    Story,
    executed_states,
    frames,
    planned_moments,
    story_of,
)
from systems.drawing.shapes import Shape
from systems.goal_region import GoalRegion
from systems.system import Array, Rollout, System

# Any browser draws so many lines smoothly; of larger trees an even choice is shown.
MOST_TREE_LINES = 5_000
# States within a command that are looked at; more are not told apart.
_MOST_MOMENTS = 13
_BESIDE_EXECUTION = 0.5


@dataclass(frozen=True, eq=False)
class Lines:
    """Straight lines with a colour each.

    Attributes
    ----------
    points : ndarray of shape (n, 2, 3)
    colors : ndarray of shape (n, 3)
        Red, green and blue, from 0 to 1.
    """

    points: Array
    colors: Array


@dataclass(frozen=True, eq=False)
class Panel:
    """What is drawn of one plan.

    Attributes
    ----------
    name : str
    summary : list of str
        Sentences about the plan and what came of it.
    scene, goal : list of shapes
        What does not move.
    goal_points : ndarray of shape (n, 3)
    tree : ndarray of shape (n, 2, 3)
        Lines of the search tree.
    planned_path, executed_path : Lines
    left_plan : ndarray of shape (n, 3)
        Where the true state was first not Close to the plan.
    planned, executed : list of list of shapes
        One list for each frame; none if there is nothing to show.
    """

    name: str
    summary: list[str]
    scene: list[Shape]
    goal: list[Shape]
    goal_points: Array
    tree: Array
    planned_path: Lines
    executed_path: Lines
    left_plan: Array
    planned: list[list[Shape]]
    executed: list[list[Shape]]


@dataclass(frozen=True)
class Sketch:
    """A panel before it is known how many frames all panels have."""

    n_transitions: int
    finish: Callable[[int, int], Panel]


def sketch_panel(
    system: System,
    plan: PlanResult | Execution,
    rollout: Rollout | None,
    goal: Array | GoalRegion | None,
    name: str,
) -> Sketch:
    """Prepare a panel; ``finish(n_transitions, frames_per_transition)`` makes it."""
    drawn = DrawnSystem(system)
    story = story_of(system, plan, rollout)
    planned = planned_moments(drawn, story) or [[drawn.reduced(story.plans[0].reduced[0])]]
    states = executed_states(system, story)
    executed = [[drawn.state(state) for state in _thinned(part)] for part in states]
    if executed:
        planned = [[_faded(shapes) for shapes in moments] for moments in planned]
    shapes, points = drawn.goals(goal)
    tree, n_edges = _tree(drawn, story)
    summary = [*_summary(plan, rollout, story)]
    if len(tree) < n_edges:
        summary.append(f"Of the search tree's {n_edges} lines, {len(tree)} are drawn.")

    def finish(n_transitions: int, per_transition: int) -> Panel:
        return Panel(
            name=name,
            summary=summary,
            scene=drawn.scene(),
            goal=shapes,
            goal_points=points,
            tree=tree,
            planned_path=_planned_path(drawn, story),
            executed_path=_executed_path(drawn, states),
            left_plan=_left_plan(drawn, story),
            planned=frames(planned, n_transitions, per_transition),
            executed=frames(executed, n_transitions, per_transition),
        )

    return Sketch(story.n_transitions, finish)


def _thinned(states: list[Any]) -> list[Any]:
    chosen = np.unique(np.linspace(0, len(states) - 1, _MOST_MOMENTS).round().astype(int))
    return [states[i] for i in chosen]


def _faded(shapes: Sequence[Shape]) -> list[Shape]:
    return [
        replace(shape, color=(*shape.color[:3], _BESIDE_EXECUTION * shape.color[3]))
        for shape in shapes
    ]


def _lines(points: Array, colors: Array) -> Lines:
    """Join the points, (n + 1, n_points, 3), of each moment to the next, colours (n, 3)."""
    pairs = np.stack([points[:-1], points[1:]], axis=2)
    return Lines(pairs.reshape(-1, 2, 3), np.repeat(colors, pairs.shape[1], axis=0))


def _joined(parts: list[Lines]) -> Lines:
    nothing = Lines(np.empty((0, 2, 3)), np.empty((0, 3)))
    parts = [nothing, *parts]
    return Lines(
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.colors for part in parts]),
    )


def _planned_path(drawn: DrawnSystem, story: Story) -> Lines:
    parts = []
    for plan in story.plans:
        if plan.reliability is None:
            colors = np.tile(NOT_ESTIMATED[:3], (len(plan.commands), 1))
        else:
            colors = reliability_colors(plan.reliability)
        parts.append(_lines(drawn.points(plan.reduced), colors))
    return _joined(parts)


def _executed_path(drawn: DrawnSystem, states: list[list[Any]]) -> Lines:
    parts = []
    for part in states:
        reduced = np.array([drawn.system.reduce(state) for state in _thinned(part)])
        colors = np.tile(EXECUTED[:3], (len(reduced) - 1, 1))
        parts.append(_lines(drawn.points(reduced), colors))
    return _joined(parts)


def _left_plan(drawn: DrawnSystem, story: Story) -> Array:
    if story.diverged_at is None:
        return np.empty((0, 3))
    state = story.states[story.diverged_at + 1]
    return drawn.points(drawn.system.reduce(state)[None])[0]


def _tree(drawn: DrawnSystem, story: Story) -> tuple[Array, int]:
    """Return the lines to draw, (n, 2, 3), and how many there are."""
    edges = np.concatenate([plan.tree for plan in story.plans])
    points = drawn.points(edges.reshape(-1, edges.shape[2]))
    ends = points.reshape(len(edges), 2, points.shape[1], 3)
    lines = ends.swapaxes(1, 2).reshape(-1, 2, 3)
    if len(lines) <= MOST_TREE_LINES:
        return lines, len(lines)
    chosen = np.linspace(0, len(lines) - 1, MOST_TREE_LINES).astype(int)
    return lines[chosen], len(lines)


def _summary(plan: PlanResult | Execution, rollout: Rollout | None, story: Story) -> list[str]:
    first = story.plans[0]
    sentences = [first.status.value if not isinstance(plan, Execution) else plan.status.value]
    if first.solved:
        worth = f"{len(first.commands)} transitions"
        if first.reliability is not None:
            worth += f", success_probability {first.success_probability:.2g}"
        sentences.append(f"{worth}.")
    if isinstance(plan, Execution):
        sentences.append(f"{len(plan.commands)} commands, {plan.n_replans} replans.")
    elif rollout is not None:
        sentences.append(str(rollout.stop_reason.value))
    if story.diverged_at is not None:
        sentences.append(f"Left the plan in transition {story.diverged_at + 1}.")
    return sentences
