"""One trial of Table I: a plan from a scene's start, executed."""

from __future__ import annotations

import argparse
import json
import os
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from planners import BiasedRRT
from reliability import load_estimator
from systems import Problem, Rope, SimulationDivergedError

TOLERANCE = 0.025
MAX_ITERATIONS = 10**8


@cache
def _scene(name: str, engine: str, features: str) -> tuple[Rope, Problem, np.ndarray]:
    rope = Rope(name, engine, features)
    problem = rope.scene_problem()
    return rope, problem, rope.reduce(problem.start)


@cache
def model_at(path: Path | None) -> Any:
    """Load an estimator once; None for none."""
    return None if path is None else load_estimator(path)


def run_trial(
    name: str,
    seed: int,
    model: Path | None,
    features: str,
    options: argparse.Namespace,
    folder: Path,
) -> dict[str, Any]:
    """Plan and execute once, or read what an earlier run found.

    The rope has ``features``, unless the model says that it was trained on others.
    """
    file = folder / name / f"seed-{seed:03d}.json"
    if file.exists():
        return dict(json.loads(file.read_text()))
    estimator = model_at(model)
    features = getattr(estimator, "provenance_", {}).get("features", features)
    rope, problem, start = _scene(name, options.engine, features)
    planner = BiasedRRT(
        rope,
        estimator,
        k=options.k,
        accuracy=options.accuracy,
        max_iterations=MAX_ITERATIONS,
        time_limit=options.time_limit,
        random_state=seed,
    )
    # A plan that takes no time compiles everything first.
    planner.plan(start, start[:6])
    result = planner.plan(start, problem.goal)
    trial = {
        "scene": name,
        "seed": seed,
        "solved": result.success,
        "planning": result.planning_time,
        "smoothing": result.simplification_time,
        "n_transitions": len(result.commands),
        "n_nodes": len(result.tree) + 1,
        "n_checked": result.n_checked,
        **_execute(rope, problem, result.commands, result.success),
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_suffix(".partial")
    partial.write_text(json.dumps(trial) + "\n")
    os.replace(partial, file)
    return trial


def _execute(rope: Rope, problem: Problem, commands: np.ndarray, solved: bool) -> dict[str, Any]:
    if not solved:
        return {"success": False, "stop_reason": "no plan", "n_completed": 0}
    try:
        rollout = rope.rollout(problem.start, commands)
    except SimulationDivergedError:
        return {"success": False, "stop_reason": "diverged", "n_completed": 0}
    return {
        "success": rope.succeeded(rollout.states[-1], problem.goal, TOLERANCE),
        "stop_reason": rollout.stop_reason.name.lower(),
        "n_completed": rollout.n_completed,
    }
