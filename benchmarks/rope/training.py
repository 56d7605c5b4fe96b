"""Training of the rope's models: the paper's VoxNet, ours, and one on thirteen numbers."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import joblib
import numpy as np
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.model_selection import GroupShuffleSplit, ShuffleSplit

from benchmarks.rope.collection import (
    N_PLANS,
    PAPER_SEED,
    RANDOM_SCENE_SEED,
    Round,
    SceneData,
    as_far_as_allowed,
    collect_random_scenes,
    collect_simple_hook,
    described,
)
from reliability import (
    FastHistGradientBoostingClassifier,
    TransitionReliabilityClassifier,
    VoxNet,
    __version__,
)
from systems.rope.features.clearance import mirrored, reversed_ends

TRAINING_SEED = 0
HELD_OUT = 0.1
ROUNDS = (
    Round(range(10_000, 11_200), biased=False),
    Round(range(11_200, 11_400), biased=True),
    Round(range(12_200, 12_400), biased=True),
    Round(range(13_000, 18_500), biased=True, slotted=True),
    Round(range(18_600, 20_600), biased=True, slotted=True),
    Round(range(22_000, 23_600), biased=True, slotted=True),
    Round(range(60_000, 61_600), biased=True, slotted=True),
    Round(range(62_000, 63_450), biased=True, slotted=True),
    Round(range(130_000, 132_000), biased=True, slotted=True),
)
# Transitions of a plan that ours learns from after the rope was caught for good: about 0.4 m.
N_AFTER = 15
# A few large trees: chosen when each call of a tree cost as much as a few rows.
N_TREES = 40
PACKAGES = ("numpy", "scikit-learn", "skorch", "torch", "mujoco")


def train_all(folder: Path, models: Path, n_jobs: int) -> None:
    """Collect, train and save all three; data and checkpoints that are in ``folder`` are used.

    Parameters
    ----------
    folder : Path
        For data and checkpoints.
    models : Path
        For ``rope_paper.joblib``, ``rope_vector.joblib`` and ``rope_ours.joblib``.
    n_jobs : int
        Processes that collect.
    """
    simple_hook = collect_simple_hook(folder, N_PLANS, n_jobs)
    save(train_vector(simple_hook), models / "rope_vector.joblib")
    save(train_ours(simple_hook, folder, n_jobs), models / "rope_ours.joblib")
    save(train_paper(simple_hook, folder / "voxnet.checkpoint"), models / "rope_paper.joblib")


def save(estimator: Any, path: Path) -> None:
    """Write an estimator, small."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    joblib.dump(estimator, partial, compress=("xz", 6))
    os.replace(partial, path)


def train_paper(simple_hook: SceneData, checkpoint: Path) -> Any:
    """Train VoxNet by the paper's protocol, on grids of half the resolution.

    Cells are pooled and an epoch draws 40,000 transitions, so that two cores need less than an
    hour; a tenth of the transitions is held out for p_acc, whatever plan they are of. Another
    tenth of the plans is kept apart.
    """
    X, y, plans, _ = described([simple_hook], "voxels")
    training, apart = _split(y, plans, HELD_OUT)
    classifier = TransitionReliabilityClassifier(
        VoxNet(pooling=2),
        rows_per_epoch=40_000,
        patience=False,
        checkpoint=str(checkpoint),
        random_state=TRAINING_SEED,
        verbose=1,
    )
    classifier.fit(X[training], y[training])
    classifier.set_params(checkpoint=None)
    classifier.provenance_ = provenance(
        "voxels",
        [simple_hook],
        by_transition=classifier.validation_accuracy_,
        by_plan=float(np.mean(classifier.predict(X[apart]) == y[apart])),
    )
    return classifier


def train_vector(simple_hook: SceneData) -> Any:
    """Train gradient boosting on the thirteen numbers, on Simple Hook alone."""
    X, y, plans, _ = described([simple_hook], "vector")

    def fitted(rows: np.ndarray) -> Any:
        boosting = HistGradientBoostingClassifier(
            class_weight="balanced", random_state=TRAINING_SEED
        )
        return boosting.fit(X[rows], y[rows])

    accuracies = _held_out_accuracies(fitted, X, y, plans)
    classifier = fitted(np.arange(len(y)))
    classifier.validation_accuracy_ = accuracies[0]
    classifier.provenance_ = provenance(
        "vector", [simple_hook], by_transition=accuracies[0], by_plan=accuracies[1]
    )
    return classifier


def train_ours(simple_hook: SceneData, folder: Path, n_jobs: int) -> Any:
    """Train gradient boosting on "clearance" features, round by round; hold out whole scenes."""
    parts, classifier = [worth_learning(simple_hook)], None
    for i, plan in enumerate(ROUNDS):
        found = collect_random_scenes(folder / f"random{i}", plan, classifier, n_jobs)
        parts += map(worth_learning, found)
        classifier = fit_clearance(parts)
    return classifier


def worth_learning(part: SceneData) -> SceneData:
    """Leave out what g does not allow, and what plans did long after they went wrong for good."""
    transitions = as_far_as_allowed(part).transitions
    return SceneData(part.scenes, transitions.trim_unreliable_tail(N_AFTER))


def fit_clearance(parts: Sequence[SceneData]) -> Any:
    """Train on Simple Hook, which comes first, and random scenes.

    Both weigh the same, and so do both labels in either. Each transition is learned as it is or
    in one of its three mirror images.
    """
    X, y, plans, scenes = described(parts, "clearance")
    weight = np.zeros(len(y))
    for kind in (2 * (scenes > 0) + y == i for i in range(4)):
        weight[kind] = len(y) / 4 / max(1, kind.sum())
    _turn_into_images(X, np.random.default_rng(TRAINING_SEED))

    def fitted(rows: np.ndarray) -> Any:
        boosting = FastHistGradientBoostingClassifier(
            max_iter=N_TREES,
            learning_rate=0.2,
            max_leaf_nodes=63,
            max_features=0.2,
            early_stopping=False,
            random_state=TRAINING_SEED,
        )
        # scikit-learn takes minutes to bin weighted rows, so they are drawn by their weights.
        rng = np.random.default_rng(TRAINING_SEED)
        drawn = rng.choice(rows, len(rows), p=weight[rows] / weight[rows].sum())
        return boosting.fit(X[drawn], y[drawn])

    accuracies = _held_out_accuracies(fitted, X, y, np.where(scenes == 0, plans, -scenes))
    classifier = fitted(np.arange(len(y)))
    classifier.validation_accuracy_ = accuracies[0]
    classifier.provenance_ = provenance("clearance", parts, *accuracies)
    return classifier


def _turn_into_images(X: np.ndarray, rng: np.random.Generator) -> None:
    kind = rng.integers(4, size=len(X))
    X[kind % 2 == 1] = mirrored(X[kind % 2 == 1])
    X[kind >= 2] = reversed_ends(X[kind >= 2])


def provenance(
    features: str, parts: Sequence[SceneData], by_transition: float, by_plan: float
) -> dict[str, Any]:
    """Tell where a model comes from."""
    return {
        "command": "python -m benchmarks.rope --train",
        "features": features,
        "seeds": {
            "simple hook": PAPER_SEED,
            "random scenes": RANDOM_SCENE_SEED,
            "training": TRAINING_SEED,
        },
        "scenes": len({id(part.scenes[i]) for part in parts for i in part.transitions.scene}),
        "plans": sum(len(np.unique(part.transitions.plan)) for part in parts),
        "transitions": sum(len(part.transitions) for part in parts),
        "accuracy by transition": by_transition,
        "accuracy by plan": by_plan,
        "versions": {name: version(name) for name in PACKAGES} | {"this library": __version__},
    }


def _held_out_accuracies(
    fitted: Callable[[np.ndarray], Any], X: np.ndarray, y: np.ndarray, groups: np.ndarray
) -> list[float]:
    """Return the accuracies by transition and by group; ``fitted`` trains on some rows."""
    accuracies = []
    for split_by in (None, groups):
        training, apart = _split(y, split_by, HELD_OUT)
        accuracies.append(float(np.mean(fitted(training).predict(X[apart]) == y[apart])))
    return accuracies


def _split(y: np.ndarray, groups: np.ndarray | None, share: float) -> tuple[np.ndarray, np.ndarray]:
    splitter = ShuffleSplit if groups is None else GroupShuffleSplit
    return next(splitter(1, test_size=share, random_state=TRAINING_SEED).split(y, groups=groups))
