"""The rope's rates on one core: g, Close, RRT extensions, Γ and the engine's share, classifiers.

Run as ``python -m benchmarks.speed.rope``; it takes about three minutes. Rates depend on the
machine, so each is also given as a multiple of another one of the same run: Γ's, the network's
alone, or that of planning without a classifier. Seconds are of this process alone.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.rope.table1 import COLUMNS
from benchmarks.speed.rope_engines import measure
from planners import BiasedRRT
from reliability import TransitionReliabilityClassifier, VoxNet, load_estimator
from systems import Rope

SCENES = ("simple_hook_short", "simple_hook", "simple_hook_long", "simple_hook_very_long")
N_PLANS = 4
REPETITIONS = 5
LEAST_SECONDS = 0.2
SEARCH_SECONDS = 10.0
# A planner asks about as many transitions at a time; a data set is judged in larger batches.
BATCHES = (1, 8, 64)


def main() -> None:
    """Print the table."""
    names = ("g/s", "Close/s", "extensions/s", "Γ/s", "engine share")
    print("| scene | " + " | ".join(names) + " |\n|---|---|---|---|---|---|")
    for scene in SCENES:
        share = measure(scene, "mujoco")[1]
        *rates, gamma = all_rates(Rope(scene))
        cells = [f"{rate:,.0f} ({rate / gamma:.1f} Γ)" for rate in rates]
        print(f"| {scene} | {' | '.join(cells)} | {gamma:,.0f} | {share:.2f} |", flush=True)
    print_voxnet(Rope("simple_hook"))
    print_boosting(Rope("simple_hook", features="clearance"))


def print_voxnet(rope: Rope) -> None:
    """Print what voxel grids and networks of 32 and of 16 cells a side cost.

    The networks have seen one epoch of random labels, and k = 0 accepts whatever they say: what
    they say does not matter to how long they take.
    """
    alone = extensions(rope, None)
    before, after = transitions(rope)
    grids = rate(lambda: rope.features(before, after), len(before))
    rows = rope.features(before, after)
    labels = np.random.default_rng(0).integers(0, 2, len(rows))
    sizes = " | ".join(f"rows/s, {n} at a time" for n in BATCHES)
    print(f"\n{grids:,.0f} voxel grids/s, {alone:,.0f} extensions/s without a classifier")
    print(f"| network | {sizes} | grids/s : rows/s | extensions/s | of rows/s | of without |")
    print("|" + "---|" * (5 + len(BATCHES)))
    for pooling in (1, 2):
        network = TransitionReliabilityClassifier(
            VoxNet(pooling=pooling), max_epochs=1, rows_per_epoch=64, random_state=0
        ).fit(rows, labels)
        judge = network.fast_decision_function
        rates = [rate(lambda n=n, judge=judge: judge(rows[:n]), n) for n in BATCHES]
        extended = extensions(rope, network)
        cells = [*(f"{each:,.0f}" for each in rates), f"{grids / rates[-1]:.0f}"]
        shares = [f"{extended / rates[1]:.2f}", f"{extended / alone:.3f}"]
        side = 32 // pooling
        print(f"| {side}³ | {' | '.join([*cells, f'{extended:,.0f}', *shares])} |", flush=True)


def print_boosting(rope: Rope) -> None:
    """Print what clearance features and the trees of Table I's "ours" cost, asked in either way."""
    model = load_estimator(COLUMNS["ours"])
    before, after = transitions(rope)
    rows = rope.features(before, after)
    sizes = " | ".join(f"rows/s, {n} at a time" for n in BATCHES)
    print(f"\n| ours | {sizes} |\n|" + "---|" * (1 + len(BATCHES)))
    calls = {
        "clearance features": lambda n: rope.features(before[:n], after[:n]),
        "trees, scikit-learn": lambda n: model.decision_function(rows[:n]),
        "trees, as planners ask": lambda n: model.fast_decision_function(rows[:n]),
    }
    with threadpool_limits(1, user_api="openmp"):
        for name, call in calls.items():
            rates = [rate(lambda n=n, call=call: call(n), n) for n in BATCHES]
            print(f"| {name} | {' | '.join(f'{each:,.0f}' for each in rates)} |", flush=True)
    alone, judged = extensions(rope, None), extensions(rope, model)
    print(f"{alone:,.0f} extensions/s without a classifier, {judged / alone:.2f} of that with ours")


def extensions(rope: Rope, estimator: Any) -> float:
    """Return transitions that a search checks per second, with or without a classifier."""
    problem = rope.scene_problem()
    start = rope.reduce(problem.start)
    n_added, seconds, seed = 0, 0.0, 0
    while seconds < SEARCH_SECONDS:
        planner = BiasedRRT(
            rope, estimator, k=0, accuracy=1.0, simplify=False, time_limit=5.0, random_state=seed
        )
        began = time.process_time()
        n_added += len(planner.plan(start, problem.goal).tree)
        seconds += time.process_time() - began
        seed += 1
    return n_added / seconds


def transitions(rope: Rope) -> tuple[np.ndarray, np.ndarray]:
    """Return b and b' along a plan."""
    problem = rope.scene_problem()
    planner = BiasedRRT(rope, simplify=False, random_state=0)
    path = planner.plan(rope.reduce(problem.start), problem.goal).reduced
    return path[:-1], path[1:]


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
    began, n_calls = time.process_time(), 0
    while n_calls < REPETITIONS or time.process_time() - began < LEAST_SECONDS:
        call()
        n_calls += 1
    return n_calls * n_rows / (time.process_time() - began)


if __name__ == "__main__":
    main()
