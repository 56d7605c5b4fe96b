"""Transitions from many scenes, in rounds: the first without a classifier, then with the last."""

from __future__ import annotations

from pathlib import Path
from typing import Any

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
    """Collect plans in scenes of the round's own, with what the last round learned.

    Parameters
    ----------
    round_number : int
    classifier : fitted classifier or None
    n_scenes, n_plans : int
        Scenes, and plans in each.
    n_jobs : int
    folder : Path
        The round is kept in a folder of its own in it; a round that was interrupted goes on.

    Returns
    -------
    transitions : Transitions
    X : ndarray of shape (n, n_features)
    """
    cars = [Car(training_scene(round_number, i)) for i in range(n_scenes)]
    planner = BiasedRRTConnect(cars[0], transitions_per_edge=1)
    if classifier is not None:
        planner = careful_planner(cars[0], classifier)
        planner.set_params(k=EXPLORING_K, max_iterations=ITERATIONS)
    transitions = collect_transitions(
        cars,
        planner,
        n_scenes * n_plans,
        n_jobs=n_jobs,
        random_state=np.random.SeedSequence([DATA_SEED, round_number]),
        path=folder / f"round-{round_number}",
        verbose=1,
    )
    return transitions, transitions.features(cars)


def informative(transitions: Transitions) -> np.ndarray:
    """Select Reliable transitions and those at which an execution diverges from its plan.

    All that follows is Unreliable, whatever it is, and in plans made without a classifier that
    is most of the transitions.
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
