"""Transitions from many scenes, in rounds: the first without a classifier, then with the last."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import joblib
import numpy as np

from benchmarks.car.compared_planners import careful_planner
from planners import BiasedRRTConnect
from reliability import (
    MLP,
    RELIABLE,
    TransitionReliabilityClassifier,
    Transitions,
    collect_transitions,
)
from systems import Car, CarScene, random_car_scene

SCENE_SEED, DATA_SEED, TRAINING_SEED = 1, 2, 3
ITERATIONS = 5000
IDS_PER_ROUND = 10**9
# Even where the classifier is wrong, a round must find out.
EXPLORING_K = 6.0
# A mistake costs three times as much as a missed chance.
CAREFUL = {0: 3.0, 1: 1.0}


def training_scene(round_number: int, i: int) -> CarScene:
    """Return one of the scenes that data come from."""
    return random_car_scene(np.random.SeedSequence([SCENE_SEED, round_number, i]))


def collect_round(
    round_number: int, classifier: Any, n_scenes: int, n_plans: int, n_jobs: int, folder: Path
) -> tuple[Transitions, np.ndarray]:
    """Collect from scenes of their own, or load what an earlier run collected.

    Returns
    -------
    transitions : Transitions
        Plan ids differ between all rounds and scenes.
    X : ndarray of shape (n, n_features)
    """
    file = folder / f"transitions-{round_number}-{n_scenes}x{n_plans}.npz"
    first_id = round_number * IDS_PER_ROUND
    if not file.exists():
        parts = joblib.Parallel(n_jobs=n_jobs)(
            joblib.delayed(_collect_scene)(round_number, i, classifier, n_plans)
            for i in range(n_scenes)
        )
        Transitions.concatenate(
            [_renumbered(part, first_id + i * n_plans) for i, part in enumerate(parts)]
        ).save(file)
    transitions = Transitions.load(file)
    scene_of_row = (transitions.plan - first_id) // n_plans
    rows = [
        transitions[scene_of_row == i].features(Car(training_scene(round_number, i)))
        for i in range(n_scenes)
    ]
    return transitions, np.concatenate(rows)


def _collect_scene(round_number: int, i: int, classifier: Any, n_plans: int) -> Transitions:
    car = Car(training_scene(round_number, i))
    planner = BiasedRRTConnect(car, transitions_per_edge=1)
    if classifier is not None:
        planner = careful_planner(car, classifier)
        planner.set_params(k=EXPLORING_K, max_iterations=ITERATIONS)
    seed = np.random.SeedSequence([DATA_SEED, round_number, i])
    return collect_transitions(car, planner, n_plans, random_state=seed)


def _renumbered(part: Transitions, first: int) -> Transitions:
    return Transitions(
        part.reduced, part.command, part.next_reduced, part.y, part.plan + first, part.step
    )


def informative(transitions: Transitions) -> np.ndarray:
    """Select Reliable transitions and first mistakes.

    What follows a mistake is Unreliable whatever it is, and most transitions of plans made
    without a classifier do.
    """
    return (transitions.y == RELIABLE) | transitions.divergence_onsets()


def train(transitions: Transitions, X: np.ndarray, class_weight: Any) -> Any:
    """Train on whole plans."""
    kept = informative(transitions)
    classifier = TransitionReliabilityClassifier(
        MLP(hidden_layer_sizes=(64, 64)),
        max_epochs=30,
        class_weight=class_weight,
        random_state=TRAINING_SEED,
    )
    return classifier.fit(X[kept], transitions.y[kept], transitions.plan[kept])
