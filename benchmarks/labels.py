"""Which labels when: Eq. 3, labels from executed states, or both, on five systems.

For each system, plans are made without a classifier, executed, and labelled in both ways, so that
what differs is the labels and nothing else. The same boosted trees learn from each kind, and
planners use them with the same k on problems that nothing was learned from. Where it says "cut",
what Eq. 3 says after a plan's first mistake is left out
(:meth:`reliability.Transitions.trim_unreliable_runs`). Everything is kept in ``--out``: a run that
was interrupted goes on where it stopped. ``docs/labels.md`` discusses the result.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, NamedTuple

from sklearn.metrics import balanced_accuracy_score

from benchmarks.shared_steps import ReachingArm
from examples.own_systems.suspended_load import SuspendedLoad
from examples.own_systems.tractor_trailer import TractorTrailer
from planners import BiasedRRT, BiasedRRTConnect, Evaluation, evaluate
from reliability import (
    FastHistGradientBoostingClassifier,
    Summary,
    Transitions,
    collect_transitions,
)
from systems import Car, PlanarArm, Rope, random_car_scene

KINDS = ("plan", "plan, cut", "executed", "both", "both, cut")
TRAINING_SEED, TEST_SEED, PROBLEM_SEED = 0, 1, 2
TRAINING_SCENES, TEST_SCENES = range(20), range(100, 120)
K, ITERATIONS = 10.0, 5000


class Setting(NamedTuple):
    """A system, and how much of it is tried.

    Attributes
    ----------
    learned, tested : System or list of Systems
        Where data come from, and where problems are solved.
    planner : class
    tolerance : float
    n_plans, n_test_plans, n_problems : int
    """

    learned: Any
    tested: Any
    planner: Any
    tolerance: float
    n_plans: int
    n_test_plans: int
    n_problems: int


def settings(name: str) -> Setting:
    """Return the setting of a system."""
    if name == "arm":
        return Setting(PlanarArm(), ReachingArm(), BiasedRRTConnect, 0.1, 1000, 200, 200)
    if name == "car":
        lots, others = _lots(TRAINING_SCENES), _lots(TEST_SCENES)
        return Setting(lots, others, BiasedRRTConnect, 0.3, 1000, 200, 200)
    if name == "rope":
        rope = Rope("simple_hook", features="vector")
        return Setting(rope, rope, BiasedRRT, 0.025, 200, 60, 30)
    if name == "tractor and trailer":
        tractor = TractorTrailer()
        return Setting(tractor, tractor, BiasedRRT, 0.15, 500, 200, 200)
    load = SuspendedLoad()
    return Setting(load, load, BiasedRRTConnect, 0.15, 500, 200, 200)


SYSTEMS = ("arm", "car", "rope", "tractor and trailer", "suspended load")


def main(arguments: list[str] | None = None) -> None:
    """Collect what is missing, learn, plan, and print the table of each system."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--systems", nargs="+", choices=SYSTEMS, default=SYSTEMS)
    parser.add_argument("--share", type=float, default=1.0, help="of the plans and problems")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("build/labels"))
    options = parser.parse_args(arguments)
    for name in options.systems:
        compare_labels(name, options)


def compare_labels(name: str, options: argparse.Namespace) -> None:
    """Learn from each kind of labels of one system, and print what came of it."""
    setting, folder = settings(name), options.out / name.replace(" ", "_")
    n_plans, n_test_plans, n_problems = (max(4, round(options.share * n)) for n in setting[-3:])
    template = setting.planner(None, max_iterations=ITERATIONS)
    collected = [
        collect_transitions(
            systems,
            template,
            n,
            labels="both",
            on_error="skip",
            n_jobs=options.jobs,
            random_state=seed,
            path=folder / f"plans-{seed}",
        )
        for systems, n, seed in (
            (setting.learned, n_plans, TRAINING_SEED),
            (setting.tested, n_test_plans, TEST_SEED),
        )
    ]
    print(f"\n{name}: {n_plans} plans to learn from, {n_test_plans} to test on")
    print("labels    transitions  Unreliable  of these diverged before  balanced accuracy")
    evaluations = {
        "no classifier": _evaluated(template, folder / "none", setting, n_problems, options)
    }
    for kind in KINDS:
        training, unseen = (_only(kind, data) for data in collected)
        estimator = FastHistGradientBoostingClassifier(random_state=0)
        estimator.fit(training.features(setting.learned), training.y)
        predicted = estimator.predict(unseen.features(setting.tested))
        summary = Summary.of(training)
        print(
            f"{kind:9s} {len(training):11,d}  {summary.unreliable_share:10.1%}  "
            f"{summary.already_diverged_share:24.1%}  "
            f"{balanced_accuracy_score(unseen.y, predicted):17.3f}"
        )
        accuracy = float((predicted == unseen.y).mean())
        planner = setting.planner(
            None, estimator, k=K, accuracy=accuracy, max_iterations=ITERATIONS
        )
        evaluations[kind] = _evaluated(
            planner, folder / kind.replace(", ", "-"), setting, n_problems, options
        )
    print(Evaluation.compare(evaluations))


def _lots(seeds: range) -> list[Car]:
    return [Car(random_car_scene(seed)) for seed in seeds]


def _only(kind: str, data: Transitions) -> Transitions:
    """Select the labels of one kind."""
    if kind == "executed":
        return data[data.executed]
    chosen = data if kind.startswith("both") else data[~data.executed]
    return chosen.trim_unreliable_runs(1) if kind.endswith("cut") else chosen


def _evaluated(
    planner: Any, folder: Path, setting: Setting, n_problems: int, options: argparse.Namespace
) -> Evaluation:
    return evaluate(
        setting.tested,
        planner,
        n_problems,
        tolerance=setting.tolerance,
        n_jobs=options.jobs,
        random_state=PROBLEM_SEED,
        path=folder,
    )


if __name__ == "__main__":
    sys.stdout.reconfigure(line_buffering=True)
    main()
