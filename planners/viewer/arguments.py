"""What users give to the viewer, checked and made into panels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from planners.execution import Execution
from planners.result import PlanResult
from planners.viewer.layout import Layout, lay_out
from planners.viewer.panel import Panel, sketch_panel
from systems.goal_region import GoalRegion
from systems.system import Rollout, System
from systems.validation import as_finite_array

# A motion of few transitions is shown in more frames each, so that it is smooth.
_SMOOTH = 120
_MOST_PER_TRANSITION = 12


@dataclass(frozen=True, eq=False)
class Show:
    """Panels, how long they last and where they stand.

    Attributes
    ----------
    panels : list of Panel
    n_transitions : int
        Of the longest motion.
    frames_per_transition : int
    layout : Layout
    """

    panels: list[Panel]
    n_transitions: int
    frames_per_transition: int
    layout: Layout

    @property
    def n_frames(self) -> int:
        """How many frames each moving thing has."""
        return self.n_transitions * self.frames_per_transition + 1


def make_show(
    system: Any, plans: Any, executed: Any, goal: Any, names: Any, width_per_height: float = 1.2
) -> Show:
    """Check the arguments of :func:`planners.show` and draw everything, as plain data."""
    plans = _as_list(plans, "plans", PlanResult | Execution)
    systems = _as_list(system, "system", System, len(plans))
    rollouts = _rollouts(executed, plans)
    names = _checked_names(names, len(plans))
    if goal is not None and not isinstance(goal, GoalRegion):
        goal = as_finite_array(goal, "goal", (None, systems[0].configuration_dim))
    sketches = [
        sketch_panel(one, plan, rollout, goal, name)
        for one, plan, rollout, name in zip(systems, plans, rollouts, names, strict=True)
    ]
    n_transitions = max(sketch.n_transitions for sketch in sketches)
    per_transition = math.ceil(_SMOOTH / max(n_transitions, 1))
    per_transition = min(per_transition, _MOST_PER_TRANSITION)
    panels = [sketch.finish(n_transitions, per_transition) for sketch in sketches]
    layout = lay_out(panels, systems[0].view_from, width_per_height)
    return Show(panels, n_transitions, per_transition, layout)


def _as_list(given: Any, name: str, kind: Any, length: int | None = None) -> list[Any]:
    """Return one or several things of a kind as a list; one stands for all of ``length``."""
    several = isinstance(given, Sequence) and not isinstance(given, str)
    things = list(given) if several else [given] * (length or 1)
    wrong = [thing for thing in things if not isinstance(thing, kind)]
    if wrong or not things:
        kinds = str(getattr(kind, "__name__", "PlanResult or Execution"))
        raise ValueError(f"{name} must be a {kinds}, or a sequence of them, got {given!r}.")
    if length is not None and len(things) != length:
        raise ValueError(f"{name} must be one, or as many as plans, {length}, got {len(things)}.")
    return things


def _rollouts(executed: Any, plans: list[Any]) -> list[Rollout | None]:
    if isinstance(executed, Sequence):
        rollouts = list(executed)
    else:
        rollouts = [None] * len(plans) if executed is None else [executed]
    if len(rollouts) != len(plans):
        raise ValueError(
            f"executed must have a Rollout or None for each of the {len(plans)} plans, got "
            f"{len(rollouts)}."
        )
    for i, (rollout, plan) in enumerate(zip(rollouts, plans, strict=True)):
        _check_rollout(rollout, plan, i)
    return rollouts


def _check_rollout(rollout: Any, plan: Any, number: int) -> None:
    if rollout is None:
        return
    if not isinstance(rollout, Rollout):
        raise ValueError(
            "executed must be a Rollout, as system.rollout returns it, or a sequence of those and "
            f"None, got {rollout!r}."
        )
    if isinstance(plan, Execution):
        raise ValueError(
            f"executed must be None for plans[{number}], an Execution, which holds its own states."
        )
    if not 1 <= len(rollout.states) <= len(plan.commands) + 1:
        raise ValueError(
            f"executed[{number}] has {len(rollout.states)} states, and its plan has "
            f"{len(plan.commands)} commands: give the rollout of this plan's commands."
        )


def _checked_names(names: Any, n_plans: int) -> list[str]:
    if names is None:
        return [f"Plan {i + 1}" for i in range(n_plans)] if n_plans > 1 else ["Plan"]
    given = [names] if isinstance(names, str) else names
    if not isinstance(given, Sequence) or not all(isinstance(n, str) and n for n in given):
        raise ValueError(f"names must be strings, one for each plan, got {names!r}.")
    if len(given) != n_plans:
        raise ValueError(f"names must be as many as plans, {n_plans}, got {len(given)}.")
    return list(given)
