"""How k, the length of edges and simplification were chosen for the arm.

Run as ``python -m benchmarks.arm.tuning``. Its queries have a seed that `benchmarks.arm` uses for
nothing else. Needs the model that `make arm` leaves in build/arm.
"""

from __future__ import annotations

import argparse
import itertools
import os
from pathlib import Path

import joblib
import numpy as np

from planners import BiasedRRTConnect
from reliability import load_estimator
from systems import PlanarArm

TUNING_SEED = 3
BETA = 0.1


def main() -> None:
    """Print success, time and length for each combination."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", type=Path, default=Path("build/arm/arm.joblib"))
    parser.add_argument("--queries", type=int, default=300)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    model = load_estimator(options.model)
    print("    k  transitions/edge  simplify   success   any start  solved  median ms  transitions")
    for k, length, simplify in itertools.product((1, 2, 4), (1, 3, 5, 8, 12), (True, False)):
        parameters = {"k": k, "transitions_per_edge": length, "simplify": simplify}
        shares = np.array_split(np.arange(options.queries), 4 * options.jobs)
        records = np.concatenate(
            joblib.Parallel(n_jobs=options.jobs)(
                joblib.delayed(answer)(model, parameters, share) for share in shares
            )
        )
        success, any_start, solved, _, length_found = records.mean(axis=0)
        print(
            f"{k:5g}  {length:16d}  {simplify!s:>8s}  {success:8.1%}   {any_start:9.1%}"
            f"  {solved:6.1%}  {1e3 * np.median(records[:, 3]):9.2f}  {length_found:11.1f}",
            flush=True,
        )


def answer(model: object, parameters: dict[str, object], queries: np.ndarray) -> np.ndarray:
    """Return success, success from any start, solved, seconds and length for each query."""
    arm = PlanarArm()
    warm = BiasedRRTConnect(arm, model, random_state=0)
    warm.plan([-1.5, 0, 0], [1.5, 0, 0])
    records = []
    for query in queries:
        row = []
        for at_rest in (True, False):
            seed = np.random.SeedSequence([TUNING_SEED, int(query)])
            problem = arm.sample_reaching_problem(seed, start_at_rest=at_rest)
            planner = BiasedRRTConnect(arm, model, random_state=int(query), **parameters)
            plan = planner.plan(problem.start, problem.goal)
            final = arm.rollout(problem.start, plan.commands).states[-1]
            row.append(plan.success and arm.succeeded(final, problem.goal, BETA))
            if at_rest:
                cost = [plan.success, plan.planning_time + plan.simplification_time]
                cost.append(len(plan.commands))
        records.append([*row, *cost])
    return np.array(records, dtype=float)


if __name__ == "__main__":
    main()
