"""The paper's Table I: rope plans with and without a classifier, executed in every scene.

Run as ``python -m benchmarks.rope.table1 --jobs 2``. Every trial starts at the scene's start and
has a seed of its own, the same in all columns. It is a success if its plan is found within the time
limit and its execution ends within 0.025 m of the goal. Each finished trial is a file in
``--out``, in a folder per column: a run that was interrupted goes on where it stopped, and one with
another planner is refused there. Columns are ``none`` and ``pbd``,
without a classifier and without or with PBD ropes, models that come with the library
(``paper``, ``ours``, ``vector``), or the file of any fitted estimator of the rope's features.
"""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

import reliability
from benchmarks.rope.table1_trials import Column, Trial
from reliability import Job, run_jobs
from systems import SCENE_NAMES

MODELS = Path(reliability.__file__).with_name("pretrained")
# Features of ropes without a classifier: nothing reads them, but with "clearance" a rope carries
# PBD ropes.
UNCLASSIFIED = {"none": "voxels", "pbd": "clearance"}
COLUMNS = {
    **dict.fromkeys(UNCLASSIFIED),
    "paper": MODELS / "rope_paper.skops",
    "ours": MODELS / "rope.skops",
    "vector": MODELS / "rope_vector.skops",
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
    parser.add_argument("--columns", nargs="+", default=["none"], help="names or files")
    parser.add_argument(
        "--features",
        choices=("voxels", "clearance", "vector"),
        default="voxels",
        help="of such files",
    )
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
    columns = {name: _column(name, options) for name in options.columns}
    stores = {name: column.store(options.out / Path(name).stem) for name, column in columns.items()}
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    keys = list(itertools.product(seeds, options.scenes, options.columns))
    jobs = [
        Job(f"{scene}-seed-{seed:03d}", Trial(columns[name], scene, seed), stores[name])
        for seed, scene, name in keys
    ]
    trials = run_jobs(jobs, n_jobs=options.jobs, verbose=1, unit="trial")
    rows: dict[str, dict[str, list[dict[str, Any]]]] = {}
    for (_, scene, name), trial in zip(keys, trials, strict=True):
        rows.setdefault(scene, {}).setdefault(name, []).append(trial.facts)
    table = format_table(rows)
    options.out.joinpath("table.md").write_text(table)
    print(f"{table}\nTrials and table are in {options.out}.")


def _column(name: str, options: argparse.Namespace) -> Column:
    if name in UNCLASSIFIED:
        return Column(None, UNCLASSIFIED[name], options.engine, time_limit=options.time_limit)
    return Column(
        COLUMNS.get(name, Path(name)),
        options.features,
        options.engine,
        options.time_limit,
        options.k,
        options.accuracy,
    )


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
    paper = PAPER[scene][name not in UNCLASSIFIED]
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
