"""What planners pay per checked transition for estimators and for what is wrapped around them.

Run as ``python -m benchmarks.speed.estimators``; it takes half a minute. Each estimator is asked
about the same transitions of the arm through ``CheckTransition``, which computes their features
and asks compiled code where it can, and through features and the public ``predict``.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from sklearn.base import clone
from sklearn.calibration import CalibratedClassifierCV
from sklearn.ensemble import (
    ExtraTreesClassifier,
    HistGradientBoostingClassifier,
    RandomForestClassifier,
)
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import FixedThresholdClassifier, GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeClassifier
from threadpoolctl import threadpool_limits

from planners import BiasedRRTConnect, CheckTransition
from reliability import TransitionReliabilityClassifier, collect_transitions
from systems import PlanarArm

BATCHES = (1, 8, 64)
N_PLANS = 60
LEAST_SECONDS = 0.05
REPETITIONS = 3

OURS = TransitionReliabilityClassifier(max_epochs=1, random_state=0)
BOOSTING = HistGradientBoostingClassifier(random_state=0)
FOREST = RandomForestClassifier(100, random_state=0)
ESTIMATORS = {
    "our classifier": OURS,
    "in a pipeline": make_pipeline(StandardScaler(), OURS),
    "calibrated": CalibratedClassifierCV(OURS, ensemble=False, cv=2),
    "boosted trees": BOOSTING,
    "with a threshold": FixedThresholdClassifier(BOOSTING, threshold=0.7),
    "from a grid search": GridSearchCV(BOOSTING, {"max_iter": [100]}, cv=2),
    "in a pipeline, calibrated": CalibratedClassifierCV(
        make_pipeline(StandardScaler(), BOOSTING), ensemble=False, cv=2, method="isotonic"
    ),
    "decision tree": DecisionTreeClassifier(random_state=0),
    "random forest of 100": FOREST,
    "calibrated, 2 forests": CalibratedClassifierCV(FOREST, cv=2),
    "extra trees, 100": ExtraTreesClassifier(100, random_state=0),
    "not compiled: logistic": LogisticRegression(),
}


def main() -> None:
    """Print the table."""
    arm = PlanarArm()
    data = collect_transitions(arm, BiasedRRTConnect(arm), N_PLANS, random_state=0)
    X = data.features(arm)
    sizes = " | ".join(f"{n} at a time" for n in BATCHES)
    print(f"µs per transition through the planner : through predict = ratio, {len(X)} rows\n")
    print(f"| estimator | {sizes} |\n|---|" + "---|" * len(BATCHES))
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, estimator in ESTIMATORS.items():
            fitted = clone(estimator).fit(X, data.y)
            cells = [compared(arm, fitted, data[:n]) for n in BATCHES]
            print(f"| {name} | {' | '.join(cells)} |", flush=True)


def compared(arm: PlanarArm, estimator: Any, transitions: Any) -> str:
    """Time one batch in both ways."""
    before, after = transitions.reduced, transitions.next_reduced
    check = CheckTransition(arm, estimator, k=np.inf, accuracy=1.0, rng=np.random.default_rng(0))
    planner = seconds_per_call(lambda: check(before, after))
    public = seconds_per_call(lambda: estimator.predict(arm.features(before, after)))
    each = 1e6 / len(before)
    return f"{each * planner:.1f} : {each * public:.1f} = {public / planner:.0f}"


def seconds_per_call(call: Callable[[], object]) -> float:
    """Return the quickest of a few means over many calls, after one that compiles."""
    call()
    means = []
    for _ in range(REPETITIONS):
        began, n_calls = time.process_time(), 0
        while time.process_time() - began < LEAST_SECONDS:
            call()
            n_calls += 1
        means.append((time.process_time() - began) / n_calls)
    return min(means)


if __name__ == "__main__":
    main()
