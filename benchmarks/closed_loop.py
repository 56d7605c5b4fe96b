"""Open loop against closed loop: what planning again is worth on four systems.

Each system is planned for without an estimator and with one. The same problems are executed once
as planned and then with ``--replans``, and compared problem by problem. The arm and the car take
the models that ``make arm`` and ``make car`` leave; for the two systems of
``examples/own_systems``, boosted trees learn from ``--plans`` executed plans. Everything is kept in
``--out``: a run that was interrupted goes on where it stopped.

Choices in :func:`planners.execute` were made with problems of other seeds (1 and 2).
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import joblib
import numpy as np

from benchmarks.shared_steps import ReachingArm
from examples.own_systems.suspended_load import SuspendedLoad
from examples.own_systems.tractor_trailer import TractorTrailer
from planners import BiasedRRT, BiasedRRTConnect, Evaluation, evaluate
from reliability import FastHistGradientBoostingClassifier, learn_in_rounds, load_estimator
from systems import Car, System, random_car_scene

SYSTEMS = ("arm", "car", "tractor_trailer", "suspended_load")
LEARNING_SEED, PROBLEM_SEED = 0, 16


def car_in_random_scene(random_state: int) -> Car:
    """Return the car in a scene of its own."""
    return Car(random_car_scene(random_state))


class Setting(NamedTuple):
    """A system with a tolerance for success, and planners without and with an estimator."""

    system: System | Callable[[int], System]
    tolerance: float
    planners: dict[str, Any]


def main() -> None:
    """Evaluate all settings, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--systems", nargs="+", choices=SYSTEMS, default=list(SYSTEMS))
    parser.add_argument("--replans", type=int, nargs="+", default=[5, 15])
    parser.add_argument("--problems", type=int, default=100)
    parser.add_argument("--plans", type=int, default=400, help="executed plans to learn from")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--arm-model", type=Path, default=Path("build/arm/arm.joblib"))
    parser.add_argument("--car-model", type=Path, default=Path("build/car/car.joblib"))
    parser.add_argument("--out", type=Path, default=Path("build/closed_loop"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    print(
        "| system | estimator | replans | successes | 95 % interval | won : lost | p "
        "| replans made | planning (s, mean) | how executions ended |\n" + "|---" * 10 + "|"
    )
    for name in options.systems:
        setting = make_setting(name, options)
        for estimator, planner in setting.planners.items():
            print_rows(name, estimator, evaluated(name, estimator, setting, planner, options))


def make_setting(name: str, options: argparse.Namespace) -> Setting:
    """Return a system with its planners."""
    if name == "arm":
        model = load_estimator(options.arm_model)
        planners = {"none": BiasedRRTConnect(None), "learned": BiasedRRTConnect(None, model)}
        return Setting(ReachingArm(), 0.1, planners)
    if name == "car":
        none = BiasedRRTConnect(None, max_iterations=8000)
        # As in benchmarks.car: no Unreliable transition, and edges of one transition.
        careful = BiasedRRTConnect(
            None,
            load_estimator(options.car_model),
            k=np.inf,
            transitions_per_edge=1,
            max_iterations=8000,
        )
        return Setting(car_in_random_scene, 0.3, {"none": none, "learned": careful})
    system: System = TractorTrailer() if name == "tractor_trailer" else SuspendedLoad()
    kind = BiasedRRT if name == "tractor_trailer" else BiasedRRTConnect
    none = kind(None, max_iterations=5000)
    learned = kind(None, learn(name, system, none, options), k=10, max_iterations=5000)
    return Setting(system, 0.15, {"none": none, "learned": learned})


def learn(name: str, system: System, planner: Any, options: argparse.Namespace) -> Any:
    """Learn from executed plans what is Reliable, or read what was learned before."""
    kept = options.out / name / f"learned-from-{options.plans}.joblib"
    if not kept.exists():
        result = learn_in_rounds(
            FastHistGradientBoostingClassifier(),
            planner,
            system,
            n_rounds=1,
            n_plans=options.plans,
            labels="executed",
            path=options.out / name / "learning",
            n_jobs=options.jobs,
            random_state=LEARNING_SEED,
        )
        joblib.dump(result.estimator, kept)
    return joblib.load(kept)


def evaluated(
    name: str, estimator: str, setting: Setting, planner: Any, options: argparse.Namespace
) -> dict[int, Evaluation]:
    """Execute the same problems with each number of replans, the first without any."""
    return {
        max_replans: evaluate(
            setting.system,
            planner,
            options.problems,
            tolerance=setting.tolerance,
            max_replans=max_replans,
            n_jobs=options.jobs,
            random_state=PROBLEM_SEED,
            path=options.out / name / f"{estimator}-{max_replans}",
        )
        for max_replans in (0, *options.replans)
    }


def print_rows(name: str, estimator: str, evaluations: dict[int, Evaluation]) -> None:
    """Print a line for each number of replans."""
    compared = Evaluation.compare({str(n): one for n, one in evaluations.items()})
    for max_replans, one in evaluations.items():
        share = one.success_share
        won, lost, p_value = compared.differing(str(max_replans))
        against = f"{won} : {lost} | {p_value:.2g}" if max_replans else " | "
        endings = Counter(status.name for status in one.status).most_common()
        print(
            f"| {name} | {estimator} | {max_replans} | {one.n_succeeded} of {one.n_problems} "
            f"| {share.low:.1%} to {share.high:.1%} | {against} | {one.n_replans.mean():.2f} "
            f"| {one.planning_time.mean():.2f} "
            f"| {', '.join(f'{ending} {n}' for ending, n in endings)} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
