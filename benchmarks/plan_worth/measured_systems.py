"""The systems on which it is measured what a plan is worth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.rope.table1 import COLUMNS
from benchmarks.shared_steps import learned_classifier
from examples.own_systems.suspended_load import SuspendedLoad
from examples.own_systems.tractor_trailer import TractorTrailer
from planners import BiasedRRT, BiasedRRTConnect
from reliability import load_estimator
from systems import Car, PlanarArm, Problem, Rope, System, random_car_scene, random_rope_scene

# ``make car`` trains it. After one round without a classifier no plan is found for the car.
CAR_MODEL = Path("build/car/car.joblib")
TRAINING_SEED = 31


@dataclass(frozen=True)
class MeasuredSystem:
    """A system, the planner that is asked, and how its classifier comes about.

    Attributes
    ----------
    scenes : System or callable
        One system, or what makes one of an integer, for each plan another.
    planner : BiasedRRT or BiasedRRTConnect
        A template without system and estimator.
    tolerance : float
        A plan succeeds if the true system ends this near to the goal.
    learned_from : int or Path
        Plans to learn from, or the file of a trained model.
    n_plans : tuple of int
        Executed plans to calibrate with, to choose a threshold with, and to measure on.
    """

    scenes: System | Callable[[int], System]
    planner: BiasedRRT
    tolerance: float
    learned_from: int | Path
    n_plans: tuple[int, int, int]

    def system(self, number: int) -> System:
        """Return the system that a plan is made in."""
        return self.scenes if isinstance(self.scenes, System) else self.scenes(number)

    def problem(self, system: System, seed: np.random.SeedSequence) -> Problem:
        """Return the problem of a rope's scene, and a drawn one of other systems."""
        return system.scene_problem() if isinstance(system, Rope) else system.sample_problem(seed)

    def classifier(self, folder: Path, n_jobs: int) -> Any:
        """Train on executed plans, or read what was trained before."""
        if isinstance(self.learned_from, Path):
            return load_estimator(self.learned_from)
        return learned_classifier(
            folder / "classifier.joblib",
            self.scenes,
            self.planner,
            self.learned_from,
            data_seed=TRAINING_SEED,
            classifier_seed=0,
            n_jobs=n_jobs,
        )


def _car(seed: int) -> System:
    return Car(random_car_scene(seed))


def _rope(seed: int) -> System:
    return Rope(random_rope_scene(seed), features="vector")


_CONNECT = BiasedRRTConnect(None, k=10.0, max_iterations=5000)
_CAR = BiasedRRTConnect(None, k=np.inf, transitions_per_edge=1, max_iterations=8000)
_RRT = BiasedRRT(None, k=10.0, max_iterations=5000)
SYSTEMS = {
    "arm": MeasuredSystem(PlanarArm(), _CONNECT, 0.1, 300, (400, 300, 750)),
    "car": MeasuredSystem(_car, _CAR, 0.3, CAR_MODEL, (300, 200, 600)),
    "rope": MeasuredSystem(_rope, _RRT, 0.025, COLUMNS["vector"], (300, 200, 300)),
    "tractor": MeasuredSystem(TractorTrailer(), _RRT, 0.1, 300, (300, 200, 545)),
    "load": MeasuredSystem(SuspendedLoad(), _CONNECT, 0.3, 300, (500, 400, 700)),
}
