"""Systems that the library was not made for: without a classifier, and along two roads.

The systems of ``examples/own_systems`` are a tractor with a trailer and a load on a crane's cable.
Both take the same code with the same parameters; only the features are their own. The roads are:

- *none*: plan with the reduced model alone.
- *0.1*: README's road as it was in version 0.1: collect plans, label them by Eq. 3, train the
  default network for 25 epochs, plan with k = 1.
- *new*: learn in rounds, plan with k = 10, calibrate on executed plans how likely a plan is to go
  well, and make ten plans of which the likeliest is carried out.
- *new, one plan*: the same without the calibration and without planning again.
- *new, replanning*: as new, and plan again from where the system is when it leaves its plan.

Both roads learn from the same number of executed plans; those with which rounds are compared, and
those for the calibration, are among them.
Choices between variants of the new road were made on other seeds (``--first-seed 1000``).
Everything is kept in ``--out``: a run that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.shared_steps import kind_of_planner
from examples.own_systems.suspended_load import SuspendedLoad
from examples.own_systems.tractor_trailer import TractorTrailer
from planners import Evaluation, SuccessCalibration, evaluate
from reliability import (
    FastHistGradientBoostingClassifier,
    LearningResult,
    TransitionReliabilityClassifier,
    collect_transitions,
    diagnose,
    learn_in_rounds,
)
from systems import System

SYSTEMS = {"tractor and trailer": TractorTrailer, "suspended load": SuspendedLoad}
TOLERANCE = 0.15  # metres
ITERATIONS = 5000
# Of the executed plans, a fifth calibrates, and a sixth tells which round to keep.
N_ROUNDS, SHARE_OF_CALIBRATION, SHARE_OF_VALIDATION = 2, 1 / 5, 1 / 6
K, RESTARTS, REPLANS = 10.0, 9, 5


@dataclass(frozen=True)
class Experiment:
    """One system, and how much of it is tried.

    Attributes
    ----------
    system : System
    folder : Path
    n_plans, n_problems : int
        Executed plans to learn from, and problems to count successes in.
    first_seed : int
        What is learned from follows from it, what is calibrated on from the next one, and the
        problems from the one after that.
    n_jobs : int
    labels : str
        Which labels the new road learns from.
    """

    system: System
    folder: Path
    n_plans: int
    n_problems: int
    first_seed: int
    n_jobs: int
    labels: str

    def planner(self, estimator: Any = None, **parameters: Any) -> Any:
        """Return the planner for a system of this kind."""
        kind = kind_of_planner(self.system)
        return kind(self.system, estimator, max_iterations=ITERATIONS, **parameters)

    def road_of_0_1(self) -> Any:
        """Follow README's road as it was, and return its planner."""
        data = collect_transitions(
            self.system,
            self.planner(),
            self.n_plans,
            n_jobs=self.n_jobs,
            random_state=self.first_seed,
            path=self.folder / "plans",
        )
        classifier = TransitionReliabilityClassifier(max_epochs=25, patience=False, random_state=0)
        classifier.fit(data.features(self.system), data.y, groups=data.plan)
        return self.planner(classifier, k=1.0)

    def learned(self) -> LearningResult:
        """Collect and learn in rounds."""
        for_rounds = round((1 - SHARE_OF_CALIBRATION - SHARE_OF_VALIDATION) * self.n_plans)
        return learn_in_rounds(
            FastHistGradientBoostingClassifier(),
            self.planner(k=K),
            self.system,
            n_rounds=N_ROUNDS,
            n_plans=for_rounds // N_ROUNDS,
            n_validation=round(SHARE_OF_VALIDATION * self.n_plans) // N_ROUNDS,
            labels=self.labels,
            n_jobs=self.n_jobs,
            random_state=self.first_seed,
            path=self.folder / "rounds",
        )

    def calibrated(self, planner: Any) -> Any:
        """Return a planner that knows how likely its plans are to go well, and makes ten."""
        tried = self.evaluated(
            planner, "calibration", round(SHARE_OF_CALIBRATION * self.n_plans), self.first_seed + 1
        )
        calibration = SuccessCalibration().fit(*tried.executed_plans)
        parameters = planner.get_params(deep=False)
        return type(planner)(**parameters | {"calibration": calibration, "restarts": RESTARTS})

    def evaluated(
        self, planner: Any, name: str, n_problems: int, seed: int, max_replans: int = 0
    ) -> Evaluation:
        """Plan and execute on problems that nothing was learned from."""
        return evaluate(
            self.system,
            planner,
            n_problems,
            tolerance=TOLERANCE,
            max_replans=max_replans,
            n_jobs=self.n_jobs,
            random_state=seed,
            path=self.folder / name,
        )

    def run(self) -> dict[str, Evaluation]:
        """Go all roads, say what was learned, and return what came of them."""
        learning = self.learned()
        print(learning)
        print(diagnose(learning.estimator, learning.transitions, self.system, n_jobs=self.n_jobs))
        one_plan = self.planner(learning.estimator, k=K)
        likeliest = self.calibrated(one_plan)
        roads = {
            "none": self.planner(),
            "0.1": self.road_of_0_1(),
            "new, one plan": one_plan,
            "new": likeliest,
            "new, replanning": likeliest,
        }
        evaluations = {}
        for name, planner in roads.items():
            replans = REPLANS if name == "new, replanning" else 0
            evaluations[name] = self.evaluated(
                planner, name.replace(", ", "-"), self.n_problems, self.first_seed + 2, replans
            )
            print(f"{name}: {evaluations[name].success_share}")
        return evaluations


def main(arguments: list[str] | None = None) -> None:
    """Run what is missing, and print a table for each system."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--systems", nargs="+", choices=SYSTEMS, default=SYSTEMS)
    parser.add_argument("--plans", type=int, default=1200, help="executed plans to learn from")
    parser.add_argument("--problems", type=int, default=200, help="to count successes in")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--labels", choices=("executed", "plan", "both"), default="executed")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("build/own_systems"))
    options = parser.parse_args(arguments)
    for name in options.systems:
        print(f"\n{name}")
        folder = options.out / f"seed-{options.first_seed}" / name.replace(" ", "_")
        experiment = Experiment(
            SYSTEMS[name](),
            folder,
            options.plans,
            options.problems,
            options.first_seed,
            options.jobs,
            options.labels,
        )
        evaluations = experiment.run()
        print(Evaluation.compare(evaluations))
        print_halved(evaluations)


def print_halved(evaluations: dict[str, Evaluation]) -> None:
    """Say whether the new road has at most half the failures of none."""
    failures = {name: one.n_problems - one.n_succeeded for name, one in evaluations.items()}
    verdict = "halved" if failures["new"] <= failures["none"] / 2 else "not halved"
    print(f"Failures {verdict}: {failures['new']} with the new road, {failures['none']} without.")


if __name__ == "__main__":
    sys.stdout.reconfigure(line_buffering=True)
    main()
