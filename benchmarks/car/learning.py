"""What the car's classifier learns from: rounds of plans, each in a random scene of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from sklearn.base import clone

from benchmarks.car.compared_planners import careful_planner
from reliability import MLP, TransitionReliabilityClassifier, learn_in_rounds
from systems import Car, random_car_scene

SCENE_SEED, DATA_SEED, TRAINING_SEED = 1, 2, 3
# Plans without a classifier are cheap, and end early in what can be learned from.
N_TIMES_FIRST = 4
# Transitions of a plan to learn from after it went wrong.
N_AFTER = 1
# A mistake costs three times as much as a missed chance.
CAREFUL = {0: 3.0, 1: 1.0}


def learn(n_rounds: int, n_plans: int, n_validation: int, n_jobs: int, path: Path) -> Any:
    """Collect and train, again and again; each round plans with what the last one learned.

    Parameters
    ----------
    n_rounds : int
    n_plans : int
        Plans of a round; the first round makes more.
    n_validation : int
        Problems on which the rounds' classifiers are compared.
    n_jobs : int
    path : Path
        Where rounds are kept; what was interrupted goes on.

    Returns
    -------
    classifier : TransitionReliabilityClassifier
    """
    classifier = TransitionReliabilityClassifier(
        MLP(hidden_layer_sizes=(64, 64)),
        max_epochs=30,
        class_weight="balanced",
        random_state=TRAINING_SEED,
    )
    result = learn_in_rounds(
        classifier,
        careful_planner(None, None),
        training_car,
        n_rounds=n_rounds,
        n_plans=(N_TIMES_FIRST * n_plans, n_plans),
        n_validation=n_validation,
        labels="plan",
        n_after=N_AFTER,
        path=path,
        n_jobs=n_jobs,
        random_state=DATA_SEED,
        verbose=1,
    )
    # In the rounds, one that is so careful would find no plans to learn from.
    careful = clone(classifier).set_params(class_weight=CAREFUL)
    rows = result.transitions[result.round <= result.kept_round].trim_unreliable_runs(N_AFTER)
    return careful.fit(rows.features(training_car), rows.y, rows.plan)


def training_car(random_state: int) -> Car:
    """Return the car in one of the scenes that data come from."""
    return Car(random_car_scene(np.random.SeedSequence([SCENE_SEED, random_state])))
