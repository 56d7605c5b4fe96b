"""Trials of Table I: a plan from a scene's start, executed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from planners import BiasedRRT
from reliability import Item, ResumableStore, code_digest, describe, load_estimator
from systems import Problem, Rope, SimulationDivergedError

TOLERANCE = 0.025
MAX_ITERATIONS = 10**8


@dataclass(frozen=True)
class Column:
    """A planner of the table, and the rope that it plans for.

    Attributes
    ----------
    model : Path or None
        File of an estimator; None for none.
    features : str
        Of the rope, unless the model says that it was trained on others.
    engine : str
        Of the rope.
    time_limit, k, accuracy : float
        Of the planner; without a model the last two don't matter.
    """

    model: Path | None
    features: str
    engine: str
    time_limit: float
    k: float = 10.0
    accuracy: float | None = None

    def rope(self, scene: str) -> Rope:
        """Return the rope in one of the paper's scenes."""
        own = getattr(model_at(self.model), "provenance_", {}).get("features", self.features)
        return Rope(scene, self.engine, own)

    def planner(self, rope: Rope | None, seed: int | None) -> BiasedRRT:
        """Return the planner of a trial."""
        return BiasedRRT(
            rope,
            model_at(self.model),
            k=self.k,
            accuracy=self.accuracy,
            max_iterations=MAX_ITERATIONS,
            time_limit=self.time_limit,
            random_state=seed,
        )

    def store(self, folder: Path) -> ResumableStore:
        """Open a folder for the column's trials."""
        rope = describe(self.rope("simple_hook"))
        description = {
            "planner": describe(self.planner(None, None)),
            "rope": {name: rope[name] for name in ("engine", "feature_kind") if name in rope},
            "code": code_digest(Rope),
            "tolerance": TOLERANCE,
        }
        return ResumableStore(folder, "trials of Table I", description)


@dataclass(frozen=True)
class Trial:
    """One seed in one scene: call it to plan and execute."""

    column: Column
    scene: str
    seed: int

    def __call__(self) -> Item:
        """Plan and execute once."""
        rope, problem, start = _problem(self.column, self.scene)
        planner = self.column.planner(rope, self.seed)
        # A plan that takes no time compiles everything first.
        planner.plan(start, start[:6])
        result = planner.plan(start, problem.goal)
        found = {
            "scene": self.scene,
            "seed": self.seed,
            "solved": result.success,
            "planning": result.planning_time,
            "smoothing": result.simplification_time,
            "n_transitions": len(result.commands),
            "n_nodes": len(result.tree) + 1,
            "n_checked": result.n_checked,
        }
        return Item({**found, **_execute(rope, problem, result.commands, result.success)})


@cache
def model_at(path: Path | None) -> Any:
    """Load an estimator once; None for none."""
    return None if path is None else load_estimator(path)


@cache
def _problem(column: Column, scene: str) -> tuple[Rope, Problem, np.ndarray]:
    rope = column.rope(scene)
    problem = rope.scene_problem()
    return rope, problem, rope.reduce(problem.start)


def _execute(rope: Rope, problem: Problem, commands: np.ndarray, solved: bool) -> dict[str, Any]:
    if not solved:
        return {"success": False, "stop_reason": "no plan", "n_completed": 0}
    try:
        rollout = rope.rollout(problem.start, commands)
    except SimulationDivergedError:
        return {"success": False, "stop_reason": "diverged", "n_completed": 0}
    return {
        "success": bool(rope.succeeded(rollout.states[-1], problem.goal, TOLERANCE)),
        "stop_reason": rollout.stop_reason.name.lower(),
        "n_completed": rollout.n_completed,
    }
