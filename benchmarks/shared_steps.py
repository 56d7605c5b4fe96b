"""Steps that several experiments take: choose a planner, learn from its plans, carry a plan out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import joblib
import numpy as np

from planners import BiasedRRT, BiasedRRTConnect
from reliability import TransitionReliabilityClassifier, collect_transitions, load_estimator
from systems import PlanarArm, Problem, SimulationDivergedError, System


class ReachingArm(PlanarArm):
    """The arm with the problems of the paper's experiment, whose goals it can hold."""

    def sample_problem(self, random_state: Any = None) -> Problem:
        """Draw a start at rest and a point for the arm's tip."""
        return self.sample_reaching_problem(random_state)


def kind_of_planner(system: System) -> type:
    """Return the planner's class for a system: RRT-Connect where it can be used."""
    extended = system.reduced_dim > system.configuration_dim
    return BiasedRRT if extended else BiasedRRTConnect


def learned_classifier(
    file: Path,
    system: System | Callable[[int], System],
    planner: Any,
    n_plans: int,
    *,
    data_seed: int,
    classifier_seed: int,
    n_jobs: int | None = None,
) -> Any:
    """Train our network on executed plans, or read from a file what was trained before.

    The plans' transitions are kept beside the file.
    """
    if not file.exists():
        data = collect_transitions(
            system,
            planner,
            n_plans,
            labels="executed",
            n_jobs=n_jobs,
            random_state=data_seed,
            path=file.parent / "transitions",
            verbose=1,
        )
        classifier = TransitionReliabilityClassifier(random_state=classifier_seed)
        classifier.fit(data.features(system), data.y, groups=data.plan)
        joblib.dump(classifier, file)
    return load_estimator(file)


def succeeds(system: System, problem: Problem, commands: np.ndarray, tolerance: float) -> bool:
    """Carry commands out from the start, and say whether the system ends near enough to the goal.

    A plan on which the simulator diverges has not gone well.
    """
    try:
        final = system.rollout(problem.start, commands).states[-1]
    except SimulationDivergedError:
        return False
    return bool(system.succeeded(final, problem.goal, tolerance))
