"""Whether memory grows with the number of plans that one process makes and executes.

Run as ``python -m benchmarks.memory``. It plans for the arm and for the rope, each plan with
another seed, with and without a classifier in turn, and executes each plan that it finds. It prints
the memory of the process after each tenth, and by how much it grew over the last eight tenths: the
first two load and compile.
"""

from __future__ import annotations

import argparse
import gc
from collections.abc import Callable

import psutil

from benchmarks.shared_steps import ReachingArm
from planners import BiasedRRT, BiasedRRTConnect
from reliability import (
    FastHistGradientBoostingClassifier,
    collect_transitions,
    load_pretrained,
)
from systems import Rope, System

N_TENTHS, FIRST = 10, 2


def main(arguments: list[str] | None = None) -> None:
    """Plan, execute and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arm", type=int, default=10_000, help="plans for the arm")
    parser.add_argument("--rope", type=int, default=1_000, help="plans for the rope")
    options = parser.parse_args(arguments)
    if options.arm:
        report("arm", arm_planner(), options.arm)
    if options.rope:
        report("rope", rope_planner(), options.rope)


def arm_planner() -> Callable[[int], None]:
    """Return what plans for the arm, from a random start to a random point, and executes."""
    arm = ReachingArm()
    data = collect_transitions(arm, BiasedRRTConnect(arm), 100, random_state=0)
    trees = FastHistGradientBoostingClassifier().fit(data.features(arm), data.y)

    def plan(seed: int) -> None:
        estimator = trees if seed % 2 else None
        planner = BiasedRRTConnect(arm, estimator, k=10, accuracy=0.9, max_iterations=300)
        executed(arm, planner, seed)

    return plan


def rope_planner() -> Callable[[int], None]:
    """Return what plans on Simple Hook from a drawn start and executes."""
    rope = Rope("simple_hook", features="clearance")
    model = load_pretrained("rope")

    def plan(seed: int) -> None:
        estimator = model if seed % 2 else None
        executed(rope, BiasedRRT(rope, estimator, k=10, max_iterations=2000), seed)

    return plan


def executed(system: System, planner: BiasedRRT, seed: int) -> None:
    """Plan with a seed, and execute what was found."""
    problem = system.sample_problem(seed)
    plan = planner.set_params(random_state=seed).plan(system.reduce(problem.start), problem.goal)
    if plan.solved:
        system.rollout(problem.start, plan.commands)


def report(name: str, plan: Callable[[int], None], n_plans: int) -> None:
    """Print a system's row of the table."""
    per_tenth = max(1, n_plans // N_TENTHS)
    measured = []
    for tenth in range(N_TENTHS):
        for seed in range(tenth * per_tenth, (tenth + 1) * per_tenth):
            plan(seed)
        gc.collect()
        measured.append(psutil.Process().memory_info().rss / 2**20)
        done = (tenth + 1) * per_tenth
        print(f"{name}, {done:,} plans: {measured[-1]:.0f} MiB", flush=True)
    growth = measured[-1] - measured[FIRST - 1]
    print(f"{name}: {growth:+.1f} MiB over the last {(N_TENTHS - FIRST) * per_tenth:,} plans")


if __name__ == "__main__":
    main()
