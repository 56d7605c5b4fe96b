"""Training of the rope's models: the paper's VoxNet, ours, and one on thirteen numbers."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.model_selection import GroupShuffleSplit, ShuffleSplit

from benchmarks.rope.collection import (
    PAPER_SEED,
    RANDOM_ITERATIONS,
    RANDOM_SCENE_SEED,
    TrainingScenes,
    collect_simple_hook,
    of_bands,
)
from planners import BiasedRRT
from reliability import (
    FastHistGradientBoostingClassifier,
    TransitionReliabilityClassifier,
    Transitions,
    VoxNet,
    __version__,
    learn_in_rounds,
    save_estimator,
)
from systems import Rope, load_scene
from systems.rope.features.clearance import mirrored, reversed_ends

TRAINING_SEED = 0
HELD_OUT = 0.1
ROWS_PER_EPOCH = 40_000
N_ROUNDS = 3
K = 10.0
# Transitions of a plan that ours learns from after the rope was caught for good: about 0.4 m.
N_AFTER = 15
# A few large trees: chosen when each call of a tree cost as much as a few rows.
N_TREES = 40
PACKAGES = ("numpy", "scikit-learn", "skorch", "torch", "mujoco")


def train_all(folder: Path, models: Path, n_plans: int, n_jobs: int) -> None:
    """Collect, train and save all three; data and checkpoints that are in ``folder`` are used.

    Parameters
    ----------
    folder : Path
        For data and checkpoints.
    n_plans : int
        In Simple Hook for the paper's models, and in each round for ours.
    models : Path
        For ``rope_paper.skops``, ``rope_vector.skops`` and ``rope.skops``, which is ours.
    n_jobs : int
        Processes that collect.
    """
    models.mkdir(parents=True, exist_ok=True)
    simple_hook = of_bands(collect_simple_hook(folder, n_plans, n_jobs))
    save_estimator(train_vector(simple_hook), models / "rope_vector.skops")
    save_estimator(train_ours(folder, n_plans, n_jobs), models / "rope.skops")
    paper = train_paper(simple_hook, folder / "voxnet.checkpoint")
    save_estimator(paper, models / "rope_paper.skops")


def train_paper(simple_hook: Transitions, checkpoint: Path) -> Any:
    """Train VoxNet by the paper's protocol, on grids of half the resolution.

    Cells are pooled and an epoch draws 40,000 transitions, so that two cores need less than an
    hour; a tenth of the transitions is held out for p_acc, whatever plan they are of. Another
    tenth of the plans is kept apart.
    """
    X, y = simple_hook.features(simple_hook_rope("voxels")), simple_hook.y
    training, apart = _split(y, simple_hook.plan, HELD_OUT)
    classifier = TransitionReliabilityClassifier(
        VoxNet(pooling=2),
        rows_per_epoch=min(ROWS_PER_EPOCH, len(y)),
        patience=False,
        checkpoint=str(checkpoint),
        random_state=TRAINING_SEED,
        verbose=1,
    )
    classifier.fit(X[training], y[training])
    classifier.set_params(checkpoint=None)
    classifier.provenance_ = provenance(
        "voxels",
        simple_hook,
        by_transition=classifier.validation_accuracy_,
        by_plan=float(np.mean(classifier.predict(X[apart]) == y[apart])),
    )
    return classifier


def train_vector(simple_hook: Transitions) -> Any:
    """Train gradient boosting on the thirteen numbers, on Simple Hook alone."""
    X, y = simple_hook.features(simple_hook_rope("vector")), simple_hook.y

    def fitted(rows: np.ndarray) -> Any:
        boosting = HistGradientBoostingClassifier(
            class_weight="balanced", random_state=TRAINING_SEED
        )
        return boosting.fit(X[rows], y[rows])

    by_transition, by_plan = _held_out_accuracies(fitted, X, y, simple_hook.plan)
    classifier = fitted(np.arange(len(y)))
    classifier.validation_accuracy_ = by_transition
    classifier.provenance_ = provenance(
        "vector", simple_hook, by_transition=by_transition, by_plan=by_plan
    )
    return classifier


def simple_hook_rope(features: str) -> Rope:
    """Return the rope in the paper's scene of training."""
    return Rope(load_scene("simple_hook"), features=features)


def train_ours(folder: Path, n_plans: int, n_jobs: int) -> Any:
    """Train gradient boosting on "clearance" features, in rounds; see :class:`TrainingScenes`."""
    result = learn_in_rounds(
        MirroredBoosting(
            max_iter=N_TREES,
            learning_rate=0.2,
            max_leaf_nodes=63,
            max_features=0.2,
            early_stopping=False,
            random_state=TRAINING_SEED,
        ),
        BiasedRRT(None, k=K, max_iterations=RANDOM_ITERATIONS),
        TrainingScenes(folder / "hard scenes"),
        n_rounds=N_ROUNDS,
        n_plans=n_plans,
        n_validation=max(1, n_plans // 10),
        labels="plan",
        exploring_k=K,
        n_after=N_AFTER,
        on_error="skip",
        path=folder / "rounds",
        n_jobs=n_jobs,
        random_state=RANDOM_SCENE_SEED,
        verbose=1,
    )
    learned = result.transitions[result.round <= result.kept_round].trim_unreliable_runs(N_AFTER)
    classifier = result.estimator.as_boosting()
    classifier.provenance_ = provenance(
        "clearance", learned, by_plan=classifier.validation_accuracy_
    )
    return classifier


class MirroredBoosting(FastHistGradientBoostingClassifier):
    """Learns each transition or one of its three mirror images; both labels weigh the same.

    Parameters are :class:`reliability.FastHistGradientBoostingClassifier`'s.
    """

    def fit(self, X: np.ndarray, y: np.ndarray) -> MirroredBoosting:
        """Fit on images of rows that are drawn by the weights of their labels."""
        rng = np.random.default_rng(self.random_state)
        # scikit-learn takes minutes to bin weighted rows.
        weight = 1 / np.bincount(y)[y]
        drawn = rng.choice(len(y), len(y), p=weight / weight.sum())
        images, kind = X[drawn], rng.integers(4, size=len(y))
        images[kind % 2 == 1] = mirrored(images[kind % 2 == 1])
        images[kind >= 2] = reversed_ends(images[kind >= 2])
        return super().fit(images, y[drawn])

    def as_boosting(self) -> FastHistGradientBoostingClassifier:
        """Return a classifier with the same trees, which a file can hold without this module."""
        boosting = FastHistGradientBoostingClassifier(**self.get_params())
        vars(boosting).update(vars(self))
        return boosting


def provenance(features: str, learned: Transitions, **accuracies: float) -> dict[str, Any]:
    """Tell where a model comes from."""
    return {
        "command": "python -m benchmarks.rope --train",
        "features": features,
        "seeds": {
            "simple hook": PAPER_SEED,
            "random scenes": RANDOM_SCENE_SEED,
            "training": TRAINING_SEED,
        },
        "scenes": len(np.unique(learned.scene)),
        "plans": len(np.unique(learned.plan)),
        "transitions": len(learned),
        **{f"accuracy {name.replace('_', ' ')}": value for name, value in accuracies.items()},
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
