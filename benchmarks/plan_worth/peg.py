"""A rope whose slack is dragged over the head of a thin peg, where outcomes hang by a hair.

Run as ``python -m benchmarks.plan_worth.peg``. In each random scene a rope has to cross a low and
narrow room in whose way a thin peg stands, and its grippers end lower than the peg's head. If the
slack has not slid off the head by the time they go down, it holds the rope. Planned is with the
reduced model alone, which an estimator that calls every transition Reliable stands for, and with
the trained model; each without and with restarts.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.dummy import DummyClassifier
from sklearn.metrics import roc_auc_score

from benchmarks.rope.table1 import COLUMNS
from planners import BiasedRRT, Evaluation, evaluate
from reliability import load_estimator
from systems import Box, Cylinder, Problem, Rope, Scene

TOLERANCE = 0.025
RANDOM_STATE = 78
HEAD = -0.05
# Plans that fewer of the varied models agree on are made again.
ENOUGH = 0.9
N_FEATURES = 496


class PegRope(Rope):
    """A rope that always begins at the start of its scene."""

    def sample_problem(self, random_state: Any = None) -> Problem:
        """Return the scene's problem."""
        return self.scene_problem()


def main(arguments: list[str] | None = None) -> None:
    """Plan, execute and print what the plans were worth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--estimators", nargs="+", default=["g", "ours"], choices=["g", "ours"])
    parser.add_argument("--plans", type=int, default=40)
    parser.add_argument("--restarts", type=int, default=5)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("build/plan_worth/peg"))
    options = parser.parse_args(arguments)
    for name in options.estimators:
        plain = planner(name)
        careful = planner(name).set_params(min_success=ENOUGH, restarts=options.restarts)
        roads = [("once", plain), ("restarts", careful)][: 1 + bool(options.restarts)]
        for label, one in roads:
            evaluation = evaluate(
                peg_rope,
                one,
                options.plans,
                tolerance=TOLERANCE,
                n_jobs=options.jobs,
                random_state=RANDOM_STATE,
                path=options.out / f"{name}-{label}",
                verbose=1,
            )
            if label == "once":
                print(f"{name}: {distrust(evaluation)}")


def planner(name: str) -> BiasedRRT:
    """Return a planner with the trained model, or with the reduced model alone."""
    if name == "ours":
        return BiasedRRT(None, load_estimator(COLUMNS["ours"]), k=10, max_iterations=20_000)
    trusting = DummyClassifier(strategy="constant", constant=1)
    trusting.fit(np.zeros((2, N_FEATURES)), [0, 1])
    return BiasedRRT(None, trusting, k=10, accuracy=1.0, max_iterations=20_000)


def peg_rope(seed: int) -> PegRope:
    """Draw a room with a peg."""
    rng = np.random.default_rng(seed)
    y, radius = rng.uniform(-0.1, 0.1), rng.uniform(0.01, 0.016)
    half_height = 0.5 * (HEAD + 0.45)
    scene = Scene(
        obstacles=[
            Box((0.0, 0.0, -0.475), (0.9, 0.6, 0.025), "floor"),
            Cylinder((0.0, y, HEAD - half_height), radius, half_height, 2, "peg"),
        ],
        bounds=np.array([[-0.4, -0.22, -0.45], [0.7, 0.22, 0.24]]),
        rope_length=0.8,
        start=np.array([[-0.2, 0.15, 0.2], [-0.2, -0.15, 0.2]]),
        goal=np.array([[0.5, 0.18, -0.2], [0.5, -0.18, -0.2]]),
        name="peg",
    )
    return PegRope(scene, features="clearance")


def distrust(evaluation: Evaluation) -> str:
    """Say how many failures are distrusted where nine tenths of the good plans are kept."""
    succeeded = evaluation.succeeded[evaluation.solved]
    probability = evaluation.success_probability[evaluation.solved]
    if succeeded.all() or not succeeded.any():
        return f"{succeeded.sum()} of {len(succeeded)} plans succeed."
    threshold = np.quantile(probability[succeeded], 0.1, method="lower")
    kept, failed = probability >= threshold, ~succeeded
    return (
        f"{succeeded.sum()} of {len(succeeded)} plans succeed, AUC "
        f"{roc_auc_score(succeeded, probability):.2f}; at min_success {threshold:.3f}, which keeps "
        f"{(kept & succeeded).sum()} of those, {(failed & ~kept).sum()} of {failed.sum()} failures "
        "are distrusted."
    )


if __name__ == "__main__":
    main()
