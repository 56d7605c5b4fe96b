"""The paper's Table I: rope plans with and without a classifier, executed in every scene.

Run as ``python benchmarks/table1.py --jobs 2``. Every trial starts at the scene's start and has
a seed of its own, the same in all columns. It is a success if its plan is found within the time
limit and its execution ends within 0.025 m of the goal. Each finished trial is a file in
``--out``: a run that was interrupted goes on where it stopped. Columns are ``none``, models that
come with the examples (``paper``, ``ours``, ``vector``), or the joblib file of any fitted
estimator of the rope's features.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
from functools import cache
from pathlib import Path
from typing import Any

import joblib
import numpy as np
from scipy.stats import binomtest

from planners import BiasedRRT
from reliability import load_estimator
from systems import Problem, Rope, SimulationDivergedError
from systems.rope_features import FEATURES
from systems.rope_scenes import SCENE_NAMES

TOLERANCE = 0.025
MAX_ITERATIONS = 10**8
MODELS = Path(__file__).parents[1] / "examples" / "models"
COLUMNS = {
    "none": None,
    "paper": MODELS / "rope_paper.joblib",
    "ours": MODELS / "rope_ours.joblib",
    "vector": MODELS / "rope_vector.joblib",
}
# Successes of 30, planning and smoothing seconds, without a classifier and with VoxNet.
PAPER = {
    "simple_hook_short": ((18, 0.6, 1.0), (30, 14.6, 5.4)),
    "simple_hook": ((20, 3.7, 4.0), (29, 17.3, 6.5)),
    "simple_hook_long": ((23, 6.8, 6.4), (29, 51.9, 8.0)),
    "simple_hook_very_long": ((18, 12.4, 15.6), (27, 15.4, 11.4)),
    "multi_hook": ((9, 11.5, 22.0), (13, 44.1, 30.0)),
    "complex_hook": ((0, 3.7, 27.0), (20, 28.7, 23.4)),
    "engine_assembly": ((1, 4.8, 0.3), (10, 2.0, 4.1)),
}


def main(arguments: list[str] | None = None) -> None:
    """Run the trials that are missing and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--columns", nargs="+", default=["none"], help="names or joblib files")
    parser.add_argument("--features", choices=FEATURES, default="voxels", help="of such files")
    parser.add_argument("--scenes", nargs="+", choices=SCENE_NAMES, default=SCENE_NAMES)
    parser.add_argument("--seeds", type=int, default=30, help="trials per scene")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--k", type=float, default=10.0)
    parser.add_argument("--accuracy", type=float, help="p_acc; default: the model's own")
    parser.add_argument("--engine", choices=("mujoco", "pybullet"), default="mujoco")
    parser.add_argument("--time-limit", type=float, default=600.0, help="seconds per search")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("build/table1"))
    options = parser.parse_args(arguments)
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    paths = {name: COLUMNS.get(name, Path(name)) for name in options.columns}
    folders = {name: options.out / _description(path, options) for name, path in paths.items()}
    keys = list(itertools.product(seeds, options.scenes, options.columns))
    trials = joblib.Parallel(n_jobs=options.jobs, verbose=5)(
        joblib.delayed(run_trial)(scene, seed, paths[name], options, folders[name])
        for seed, scene, name in keys
    )
    rows: dict[str, dict[str, list[dict[str, Any]]]] = {}
    for (_, scene, name), trial in zip(keys, trials, strict=True):
        rows.setdefault(scene, {}).setdefault(name, []).append(trial)
    table = format_table(rows)
    options.out.joinpath("table.md").write_text(table)
    print(f"{table}\nTrials and table are in {options.out}.")


def _description(path: Path | None, options: argparse.Namespace) -> str:
    """Name a folder after everything that makes trials differ."""
    planner = "none"
    if path is not None:
        digest = joblib.hash(load_estimator(path))[:8]
        accuracy = "own" if options.accuracy is None else f"{options.accuracy:g}"
        planner = f"{path.stem}-{digest}-k{options.k:g}-accuracy-{accuracy}"
    return f"{planner}-{options.engine}-{options.time_limit:g}s"


@cache
def _scene(name: str, engine: str, features: str) -> tuple[Rope, Problem, np.ndarray]:
    rope = Rope(name, engine, features)
    problem = rope.scene_problem()
    return rope, problem, rope.reduce(problem.start)


@cache
def _model(path: Path | None) -> Any:
    return None if path is None else load_estimator(path)


def run_trial(
    name: str, seed: int, model: Path | None, options: argparse.Namespace, folder: Path
) -> dict[str, Any]:
    """Plan and execute once, or read what an earlier run found."""
    file = folder / name / f"seed-{seed:03d}.json"
    if file.exists():
        return dict(json.loads(file.read_text()))
    estimator = _model(model)
    features = getattr(estimator, "provenance_", {}).get("features", options.features)
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


def format_table(trials: dict[str, dict[str, list[dict[str, Any]]]]) -> str:
    """Return the table as text; trials are per scene and column."""
    lines = [
        "| scene | planner | success | 95 % | paper | planning (s) | paper | smoothing (s) | paper "
        "| transitions | no plan |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for scene, columns in trials.items():
        for name, rows in columns.items():
            lines.append("| " + " | ".join(_cells(scene, name, rows)) + " |")
    return "\n".join(lines) + "\n"


def _cells(scene: str, name: str, rows: list[dict[str, Any]]) -> tuple[str, ...]:
    n_successes = sum(row["success"] for row in rows)
    interval = binomtest(n_successes, len(rows)).proportion_ci(method="wilson")
    paper = PAPER[scene][name != "none"]
    solved = [row for row in rows if row["solved"]]
    lengths = [row["n_transitions"] for row in solved] or [0]
    return (
        scene,
        name,
        f"{n_successes}/{len(rows)}",
        f"{interval.low:.0%} to {interval.high:.0%}",
        f"{paper[0]}/30",
        f"{np.mean([row['planning'] for row in rows]):.1f}",
        f"{paper[1]}",
        f"{np.mean([row['smoothing'] for row in rows]):.1f}",
        f"{paper[2]}",
        f"{np.mean(lengths):.0f}",
        f"{len(rows) - len(solved)}",
    )


if __name__ == "__main__":
    main()
