"""The paper's arm experiment, from no data to its table and pictures.

Collects transitions by executing plans, trains classifiers on them, and compares four planners
on random queries, as in the section "Application to a torque-limited planar arm". Everything
goes to ``--out``; a run that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import joblib
import numpy as np
from scipy.stats import binomtest
from tqdm.auto import tqdm

from benchmarks.arm.compared_planners import (
    PLANNERS,
    RawFeatureArm,
    execute,
    make_planner,
    most_reliable_plan,
)
from benchmarks.arm.pictures import draw_motions, draw_success
from reliability import (
    RELIABLE,
    UNRELIABLE,
    TransitionReliabilityClassifier,
    Transitions,
    collect_transitions,
)
from systems import PlanarArm

# Data, training, tuning (benchmarks.arm.tuning, seed 3) and queries have different seeds.
DATA_SEED, TRAINING_SEED, QUERY_SEED, ANY_START_SEED, DEMO_SEED = 1, 2, 4, 5, 6
THRESHOLDS = (0.02, 0.03, 0.05, 0.075, 0.1, 0.2, 0.5, 1.0, 2.0)
BETA = 0.1
HANGING, STANDING = np.array([-np.pi / 2, 0, 0]), np.array([np.pi / 2, 0, 0])
N_DEMOS = 20


def main(arguments: list[str] | None = None) -> None:
    """Run the experiment."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plans", type=int, default=6000, help="plans to collect data from")
    parser.add_argument("--queries", type=int, default=400, help="queries per table")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--out", type=Path, default=Path("build/arm"))
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)

    transitions = collect(options)
    classifiers = train(transitions, options.out)
    report_accuracy(transitions, classifiers)
    demonstrate(classifiers["ours"], options.out)
    results = {
        "Starts at which the arm can rest": experiment(classifiers, QUERY_SEED, True, options),
        "Any start": experiment(classifiers, ANY_START_SEED, False, options),
    }
    for title, rows in results.items():
        print_table(title, rows)
    (options.out / "results.json").write_text(json.dumps(results, indent=1) + "\n")
    draw_success(results, THRESHOLDS, options.out / "success.png")
    print(f"Pictures and results are in {options.out}.")


def collect(options: argparse.Namespace) -> Transitions:
    """Execute plans made without a classifier, between random configurations."""
    arm = PlanarArm()
    began = time.perf_counter()
    transitions = collect_transitions(
        arm,
        make_planner("none", arm, {}, 0),
        options.plans,
        n_jobs=options.jobs,
        random_state=DATA_SEED,
        path=options.out / "transitions",
        verbose=1,
    )
    transitions.save(options.out / "transitions.npz")
    unreliable = transitions.y == UNRELIABLE
    already = 1 - transitions.divergence_onsets().sum() / unreliable.sum()
    print(f"Collecting took {time.perf_counter() - began:.0f} s.")
    print(f"{already:.1%} of the Unreliable labels say that a plan had diverged already.")
    return transitions


def train(transitions: Transitions, out: Path) -> dict[str, TransitionReliabilityClassifier]:
    """Train on whole plans, on single transitions, and on the paper's raw features."""
    X, y = transitions.features(PlanarArm()), transitions.y
    raw = transitions.features(RawFeatureArm())
    # The paper's four epochs; of an early end its text says nothing.
    four = {"max_epochs": 4, "patience": False}
    recipes = {
        "ours": (X, transitions.plan, {}),
        "ours, by transition": (X, None, {}),
        "literal": (raw, None, four),
        "literal, by plan": (raw, transitions.plan, four),
    }
    classifiers = {}
    for name, (rows, groups, parameters) in recipes.items():
        began = time.perf_counter()
        classifier = TransitionReliabilityClassifier(random_state=TRAINING_SEED, **parameters)
        print(f"Training: {name}", flush=True)
        classifiers[name] = classifier.set_params(verbose=1).fit(rows, y, groups)
        print(f"  took {time.perf_counter() - began:.0f} s")
    joblib.dump(classifiers["ours"], out / "arm.joblib")
    return classifiers


def report_accuracy(
    transitions: Transitions, classifiers: dict[str, TransitionReliabilityClassifier]
) -> None:
    """Print held-out accuracies, by transition as in the paper and by whole plans."""
    majority = max(np.mean(transitions.y == RELIABLE), np.mean(transitions.y == UNRELIABLE))
    print(f"\nHeld-out accuracy (the larger class alone: {majority:.1%})")
    for name, by_transition, by_plan in (
        ("ours", "ours, by transition", "ours"),
        ("literal (raw features, 4 epochs)", "literal", "literal, by plan"),
    ):
        split = [classifiers[key].validation_accuracy_ for key in (by_transition, by_plan)]
        print(f"  {name:34s} by transition {split[0]:.2%}, by plan {split[1]:.2%}")


def demonstrate(classifier: TransitionReliabilityClassifier, out: Path) -> None:
    """Plan from hanging down to standing up, with and without the classifier, and draw both."""
    arm = PlanarArm()
    motions, successes = {}, {}
    for name in ("ours", "none"):
        plans = [
            make_planner(name, arm, {"ours": classifier}, DEMO_SEED + i).plan(HANGING, STANDING)
            for i in range(N_DEMOS)
        ]
        executed = [arm.rollout(HANGING, plan.commands).states for plan in plans]
        reached = [arm.succeeded(states[-1], STANDING[None], BETA) for states in executed]
        successes[name] = sum(plan.success and ok for plan, ok in zip(plans, reached, strict=True))
        motions[name] = (plans[0].reduced, executed[0])
    print(
        f"\nFrom hanging to standing: {successes['ours']} of {N_DEMOS} with the classifier, "
        f"{successes['none']} of {N_DEMOS} without."
    )
    draw_motions(arm, motions, out / "motions.png")


def experiment(
    classifiers: dict[str, TransitionReliabilityClassifier],
    seed: int,
    start_at_rest: bool,
    options: argparse.Namespace,
) -> dict[str, list[dict[str, float]]]:
    """Answer the same queries with every planner; return a record per query and planner."""
    names = list(PLANNERS) if start_at_rest else [*PLANNERS, "ours, best of 6"]
    n_shares = min(options.queries, 8 * options.jobs)
    shares = np.array_split(np.arange(options.queries), n_shares)
    tasks = (
        joblib.delayed(answer)(names, classifiers, seed, start_at_rest, share) for share in shares
    )
    answered = joblib.Parallel(n_jobs=options.jobs, return_as="generator")(tasks)
    by_share = list(tqdm(answered, total=len(shares), unit="share", desc="Queries"))
    return {name: [record for share in by_share for record in share[name]] for name in names}


def answer(
    names: list[str],
    classifiers: dict[str, TransitionReliabilityClassifier],
    seed: int,
    start_at_rest: bool,
    queries: np.ndarray,
) -> dict[str, list[dict[str, float]]]:
    """Plan and execute some of the queries."""
    arm = PlanarArm()
    for name in names:
        # Compiled code is loaded on first use, which is no part of planning.
        plan_query(name, arm, classifiers, HANGING, HANGING[None] + 0.2, seed=0)
    records: dict[str, list[dict[str, float]]] = {name: [] for name in names}
    for query in queries:
        problem = arm.sample_reaching_problem(
            np.random.SeedSequence([seed, int(query)]), start_at_rest=start_at_rest
        )
        for name in names:
            result = plan_query(name, arm, classifiers, problem.start, problem.goal, int(query))
            records[name].append(execute(arm, problem, result))
    return records


def plan_query(
    name: str,
    arm: PlanarArm,
    classifiers: dict[str, TransitionReliabilityClassifier],
    start: np.ndarray,
    goal: np.ndarray,
    seed: int,
) -> Any:
    """Plan with one of the planners of the comparison."""
    if name == "ours, best of 6":
        return most_reliable_plan(arm, classifiers, start, goal, seed, n_plans=6)
    return make_planner(name, arm, classifiers, seed).plan(start, goal)


def print_table(title: str, results: dict[str, list[dict[str, float]]]) -> None:
    """Print successes against β, and times."""
    n = len(next(iter(results.values())))
    print(f"\n{title}: successes out of {n}, by β (rad)")
    header = "".join(f"{beta:>7g}" for beta in THRESHOLDS)
    print(f"{'':24s}{header}   95 % at β = {BETA:g}  solved  plan+simplify (ms)  µs/transition")
    unbiased = median_time(results["none"])
    for name, records in results.items():
        distances = np.array([record["distance"] for record in records])
        counts = [int((distances < beta).sum()) for beta in THRESHOLDS]
        hits = int((distances < BETA).sum())
        interval = binomtest(hits, n).proportion_ci(method="wilson")
        solved = sum(record["solved"] for record in records)
        checked = sum(record["n_checked"] for record in records)
        spent = sum(record["planning"] + record["simplification"] for record in records)
        each = f"{1e6 * spent / checked:13.1f}" if checked else f"{'-':>13s}"
        print(
            f"{name:24s}"
            + "".join(f"{count:7d}" for count in counts)
            + f"    {interval.low:.1%} - {interval.high:.1%} {solved:7d}"
            + f"  {1e3 * median_time(records):8.2f} ({median_time(records) / unbiased:4.1f}x)"
            + f"  {each}"
        )


def median_time(records: list[dict[str, float]]) -> float:
    """Return the median of planning and simplification together, in seconds."""
    return float(np.median([record["planning"] + record["simplification"] for record in records]))


if __name__ == "__main__":
    sys.stdout.reconfigure(line_buffering=True)
    main()
