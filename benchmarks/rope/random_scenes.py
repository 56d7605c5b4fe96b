"""Plans in random scenes that nothing was learned from, with each of Table I's columns.

Run as ``python -m benchmarks.rope.random_scenes --jobs 2``. Of the random scenes drawn from
``--first`` on, those count in which the rope has to pass a slot (a narrow gap in a wall between the
grippers) and a slit (a gap in a wall across the way), and in which the first plan without a
classifier goes wrong. Their seed is not that of the scenes that the models learned from. A scene
takes about a minute; a line is printed for each, and the sums at the end.
"""

from __future__ import annotations

import argparse
from collections import Counter

import joblib
import numpy as np

from benchmarks.rope.table1 import COLUMNS, UNCLASSIFIED
from benchmarks.rope.table1_trials import MAX_ITERATIONS, TOLERANCE, model_at
from planners import BiasedRRT
from systems import (
    Rope,
    Scene,
    SimulationDivergedError,
    has_slot_and_slit,
    random_rope_scene,
)

SEED = 2026
K = 10.0
# Without a classifier a plan is found in a few seconds, if there is a way.
SECONDS_WITHOUT = 10.0
OUTCOMES = ("right", "wrong", "no plan")


def main(arguments: list[str] | None = None) -> None:
    """Plan in every random scene and print what became of the plans."""
    parser = argparse.ArgumentParser(description=__doc__)
    columns = ["vector", "pbd", "ours"]
    parser.add_argument("--columns", nargs="+", choices=COLUMNS, default=columns)
    parser.add_argument("--first", type=int, default=0, help="first random scene to draw")
    parser.add_argument("--scenes", type=int, default=300, help="random scenes to draw")
    parser.add_argument("--time-limit", type=float, default=60.0, help="seconds per search")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    options = parser.parse_args(arguments)
    found = joblib.Parallel(n_jobs=options.jobs)(
        joblib.delayed(plan_in_random_scene)(i, options.columns, options.time_limit)
        for i in range(options.first, options.first + options.scenes)
    )
    scenes = [outcomes for outcomes in found if outcomes]
    print(f"{len(scenes)} random scenes")
    for name in options.columns:
        counts = Counter(outcomes[name] for outcomes in scenes)
        print(f"{name:8}" + ", ".join(f"{counts[outcome]} {outcome}" for outcome in OUTCOMES))


def plan_in_random_scene(i: int, columns: list[str], time_limit: float) -> dict[str, str]:
    """Return what becomes of each column's plan; nothing if the random scene does not count."""
    scene = random_rope_scene(np.random.SeedSequence([SEED, i]))
    if not has_slot_and_slit(scene):
        return {}
    try:
        if outcome(scene, "none", i, SECONDS_WITHOUT) != "wrong":
            return {}
        outcomes = {name: outcome(scene, name, i, time_limit) for name in columns}
    except (ValueError, SimulationDivergedError):  # there is no room for the rope
        return {}
    print(f"random scene {i}: {outcomes}", flush=True)
    return outcomes


def outcome(scene: Scene, name: str, seed: int, time_limit: float) -> str:
    """Plan and execute once."""
    estimator = model_at(COLUMNS[name])
    features = UNCLASSIFIED.get(name) or estimator.provenance_["features"]
    rope = Rope(scene, features=features)
    problem = rope.scene_problem()
    planner = BiasedRRT(
        rope,
        estimator,
        k=K,
        max_iterations=MAX_ITERATIONS,
        time_limit=time_limit,
        random_state=seed,
    )
    plan = planner.plan(rope.reduce(problem.start), problem.goal)
    if not plan.success:
        return "no plan"
    last = rope.rollout(problem.start, plan.commands).states[-1]
    return "right" if rope.succeeded(last, problem.goal, TOLERANCE) else "wrong"


if __name__ == "__main__":
    main()
