"""Which classifier to give a planner: our network, with and without its defaults, or boosted trees.

Run as ``python -m benchmarks.classifiers``. On the arm and on the two systems of
examples/own_systems, each classifier learns from ``--plans`` executed plans, labelled from executed
states, and is asked about 300 plans that it has not seen. Planners that ask it, with
k = 10, then solve 100 problems of their own. Everything goes to ``--out``; a run that was
interrupted goes on where it stopped. Nothing was tuned on these plans and problems.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.base import clone
from sklearn.metrics import balanced_accuracy_score
from sklearn.model_selection import GroupShuffleSplit
from threadpoolctl import threadpool_limits
from torch import nn

from benchmarks.calibration_error import calibration_error
from benchmarks.shared_steps import kind_of_planner
from examples.own_systems.suspended_load import SuspendedLoad
from examples.own_systems.tractor_trailer import TractorTrailer
from planners import evaluate
from reliability import (
    FastHistGradientBoostingClassifier,
    TransitionReliabilityClassifier,
    Transitions,
    collect_transitions,
)
from systems import PlanarArm, System

TRAINING_SEED, TEST_SEED, PROBLEM_SEED = 11, 12, 13
N_TEST_PLANS = 300
SIZES = (100, 300, 1000)
# Of the accuracy, on other plans and other seeds of the classifier.
N_REPETITIONS = 3
K = 10.0
MOST_ITERATIONS = 5000
SYSTEMS = {
    "arm": (PlanarArm, 0.1),
    "tractor_trailer": (TractorTrailer, 0.15),
    "suspended_load": (SuspendedLoad, 0.15),
}


class PlainNetwork(nn.Sequential):
    """The layers of "mlp", whose features are not standardized and epochs are single passes."""

    def __init__(self, n_features: int) -> None:
        sizes = (n_features, 256, 128, 64)
        layers: list[nn.Module] = []
        for n_inputs, n_outputs in pairwise(sizes):
            layers += [nn.Linear(n_inputs, n_outputs), nn.LeakyReLU()]
        super().__init__(*layers, nn.Linear(sizes[-1], 1))


CLASSIFIERS = {
    "ours": TransitionReliabilityClassifier(),
    "ours, without its defaults": TransitionReliabilityClassifier(PlainNetwork, patience=False),
    "boosted trees": FastHistGradientBoostingClassifier(),
}


def main(arguments: list[str] | None = None) -> None:
    """Collect, train, measure and print two tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plans", type=int, nargs="+", choices=SIZES, default=SIZES)
    parser.add_argument("--problems", type=int, default=100, help="problems per planner")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("build/classifiers"))
    options = parser.parse_args(arguments)
    data = {name: collect(name, options) for name in SYSTEMS}
    with threadpool_limits(1, user_api="openmp"):
        measure_accuracy(data, options.plans, options.out / "accuracy.json")
        plan(data, options)


def collect(name: str, options: argparse.Namespace) -> tuple[Transitions, Transitions]:
    """Return the transitions of plans to learn from and of plans to test on."""
    system = SYSTEMS[name][0]()
    training, test = (
        collect_transitions(
            system,
            make_planner(system),
            n_plans,
            labels="executed",
            n_jobs=options.jobs,
            random_state=seed,
            path=options.out / name / part,
            verbose=1,
        )
        for part, n_plans, seed in (
            ("train", max(SIZES), TRAINING_SEED),
            ("test", N_TEST_PLANS, TEST_SEED),
        )
    )
    return training, test


def make_planner(system: System, estimator: Any = None) -> Any:
    """Return the planner for a system, with an estimator or without."""
    kind = kind_of_planner(system)
    if estimator is None:
        return kind(system)
    return kind(system, estimator, k=K, max_iterations=MOST_ITERATIONS)


def train(name: str, system: System, plans: Transitions, seed: int) -> Any:
    """Train a classifier, and give it a validation accuracy."""
    X = plans.features(system)
    classifier = clone(CLASSIFIERS[name]).set_params(random_state=seed)
    if isinstance(classifier, TransitionReliabilityClassifier):
        return classifier.fit(X, plans.y, plans.plan)
    splitter = GroupShuffleSplit(test_size=0.2, random_state=seed)
    rows, held_out = next(splitter.split(X, plans.y, plans.plan))
    partly = clone(classifier).fit(X[rows], plans.y[rows])
    classifier.fit(X, plans.y)
    classifier.validation_accuracy_ = partly.score(X[held_out], plans.y[held_out])
    return classifier


def some_plans(plans: Transitions, n: int, seed: int) -> Transitions:
    """Draw n of the plans."""
    chosen = np.random.default_rng(seed).permutation(np.unique(plans.plan))[:n]
    return plans[np.isin(plans.plan, chosen)]


def measure_accuracy(
    data: dict[str, tuple[Transitions, Transitions]], sizes: Sequence[int], path: Path
) -> None:
    """Print accuracies on plans that no classifier has seen."""
    known = json.loads(path.read_text()) if path.exists() else {}
    columns = ["balanced accuracy", "told - accuracy", "calibration error", "as told"]
    print(f"\n| system | plans | classifier | {' | '.join(columns)} |\n|" + "---|" * 7)
    for n in sizes:
        for system_name, (training, test) in data.items():
            for name in CLASSIFIERS:
                key = f"{system_name}, {n}, {name}"
                if key not in known:
                    known[key] = [
                        accuracy(system_name, training, test, n, name, seed)
                        for seed in range(N_REPETITIONS)
                    ]
                    path.write_text(json.dumps(known, indent=1) + "\n")
                cells = " | ".join(
                    _mean_and_spread(column) for column in zip(*known[key], strict=True)
                )
                print(f"| {system_name} | {n} | {name} | {cells} |", flush=True)


def accuracy(
    system_name: str, training: Transitions, test: Transitions, n: int, name: str, seed: int
) -> tuple[float, float, float, float]:
    """Return what a classifier is worth on the test plans.

    Returns
    -------
    balanced : float
        Balanced accuracy.
    overstated : float
        By how much ``validation_accuracy_`` is above the accuracy.
    calibration_error, told_error : float
        Expected calibration error, and what the classifier tells of it; NaN if it tells nothing.
    """
    system = SYSTEMS[system_name][0]()
    classifier = train(name, system, some_plans(training, n, seed), seed)
    probability = classifier.predict_proba(test.features(system))[:, 1]
    predicted = probability > 0.5
    told = getattr(classifier, "validation_calibration_error_", float("nan"))
    return (
        float(balanced_accuracy_score(test.y, predicted)),
        float(classifier.validation_accuracy_ - np.mean(predicted == test.y)),
        calibration_error(probability, test.y == 1),
        told,
    )


def _mean_and_spread(values: tuple[float, ...]) -> str:
    return f"{np.mean(values):.3f} ± {np.std(values, ddof=1):.3f}"


def plan(data: dict[str, tuple[Transitions, Transitions]], options: argparse.Namespace) -> None:
    """Print the executed successes of planners, with Wilson intervals."""
    print("\n| system | plans | classifier | success | solved |\n|" + "---|" * 5)
    for system_name in data:
        report(system_name, 0, "none", None, options)
    for n in options.plans:
        for system_name, (training, _) in data.items():
            for name in CLASSIFIERS:
                system = SYSTEMS[system_name][0]()
                classifier = train(name, system, some_plans(training, n, 0), 0)
                report(system_name, n, name, classifier, options)


def report(
    system_name: str, n: int, name: str, classifier: Any, options: argparse.Namespace
) -> None:
    """Plan and execute, and print a row."""
    make, tolerance = SYSTEMS[system_name]
    system = make()
    label = name.replace(",", "").replace(" ", "_")
    evaluation = evaluate(
        system,
        make_planner(system, classifier),
        options.problems,
        tolerance=tolerance,
        n_jobs=options.jobs,
        random_state=PROBLEM_SEED,
        path=options.out / system_name / f"{label}-{n}",
    )
    shares = f"{evaluation.success_share} | {evaluation.n_solved}"
    print(f"| {system_name} | {n} | {name} | {shares} |", flush=True)


if __name__ == "__main__":
    sys.stdout.reconfigure(line_buffering=True)
    main()
