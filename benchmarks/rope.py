"""The rope's rates on one core: g, Close, RRT extensions, Γ, and the engine's share of Γ.

Run as ``python benchmarks/rope.py``; it takes about a minute. Rates depend on the machine, so
each is also given as a multiple of Γ's in the same run. Seconds are of this process alone.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from rope_engines import measure

from planners import BiasedRRT
from systems import Rope

SCENES = ("simple_hook_short", "simple_hook", "simple_hook_long", "simple_hook_very_long")
N_PLANS = 4
REPETITIONS = 5


def main() -> None:
    """Print the table."""
    names = ("g/s", "Close/s", "extensions/s", "Γ/s", "engine share")
    print("| scene | " + " | ".join(names) + " |\n|---|---|---|---|---|---|")
    for scene in SCENES:
        share = measure(scene, "mujoco")[1]
        *rates, gamma = all_rates(Rope(scene))
        cells = [f"{rate:,.0f} ({rate / gamma:.1f} Γ)" for rate in rates]
        print(f"| {scene} | {' | '.join(cells)} | {gamma:,.0f} | {share:.2f} |", flush=True)


def all_rates(rope: Rope) -> tuple[float, float, float, float]:
    """Return g calls, Close calls, states added to a tree and Γ transitions, per second.

    g, Close and Γ are called along the plans that were found.
    """
    problem = rope.scene_problem()
    start = rope.reduce(problem.start)
    BiasedRRT(rope, max_iterations=100, random_state=0).plan(start, problem.goal)
    plans, seconds, n_added = [], 0.0, 0
    for seed in range(N_PLANS):
        planner = BiasedRRT(
            rope, simplify=False, max_iterations=10**6, time_limit=30.0, random_state=seed
        )
        began = time.process_time()
        plans.append(planner.plan(start, problem.goal))
        seconds += time.process_time() - began
        n_added += len(plans[-1].tree)
    before = np.concatenate([plan.reduced[:-1] for plan in plans])
    after = np.concatenate([plan.reduced[1:] for plan in plans])
    commands = np.concatenate([plan.commands for plan in plans])
    g = rate(lambda: rope.propagate(before, commands), len(before))
    close = rate(lambda: rope.close(before, after), len(before))
    began = time.process_time()
    n_executed = sum(rope.rollout(problem.start, plan.commands).n_completed for plan in plans)
    gamma = n_executed / (time.process_time() - began)
    return g, close, n_added / seconds, gamma


def rate(call: Callable[[], object], n_rows: int) -> float:
    """Return rows per second of a batch that was run once before."""
    call()
    began = time.process_time()
    for _ in range(REPETITIONS):
        call()
    return REPETITIONS * n_rows / (time.process_time() - began)


if __name__ == "__main__":
    main()
