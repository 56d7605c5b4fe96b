"""How to accept Unreliable transitions: the planners' three rules on the same unseen problems.

Run as ``python -m benchmarks.acceptance --systems arm car --jobs 2``; without ``--systems`` on all.
The rules are planned with and the plans executed. ``--tuning`` does so for more settings, on other
problems; the settings of the table were chosen there. Models of the arm and of the car are those
of ``make arm`` and ``make car``, the rope's comes with the benchmarks, and those of the systems in
``examples/own_systems`` are learned here. What is missing is made first. Each finished trial is a
file in ``--out``: a run that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.arm.__main__ import main as make_arm
from benchmarks.car.__main__ import main as make_car
from benchmarks.rope.table1 import COLUMNS
from benchmarks.shared_steps import learned_classifier, succeeds
from examples.own_systems.suspended_load import SuspendedLoad
from examples.own_systems.tractor_trailer import TractorTrailer
from planners import BiasedRRT, BiasedRRTConnect, Share
from reliability import (
    Item,
    Job,
    ResumableStore,
    code_digest,
    describe,
    load_estimator,
    run_jobs,
)
from systems import Car, PlanarArm, Problem, Rope, System, random_car_scene

# Of problems to choose settings on, of those of the table, and of the data to learn from.
TUNING_SEED, TEST_SEED, DATA_SEED = 31, 32, 33
PROBLEMS_PER_CAR_SCENE = 5
# Rules with their k, each chosen on the tuning problems.
SETTINGS = (("fixed", 1.0), ("fixed", 10.0), ("probability", 3.0), ("temperature", 10.0))
TUNED = (
    *(("fixed", k) for k in (1.0, 3.0, 10.0, np.inf)),
    *(("probability", k) for k in (1.0, 3.0, 10.0)),
    *(("temperature", k) for k in (1.0, 10.0, 100.0)),
)


@dataclass(frozen=True)
class Scenario:
    """Problems of one kind, and how to plan for them.

    Attributes
    ----------
    n_problems : int
        In the table.
    tolerance : float
    sample : callable
        Maps a seed and a problem's number to a system and a problem.
    model : callable
        Maps the folder of results to a fitted estimator.
    planner : class
    parameters : dict
        Of the planner.
    """

    n_problems: int
    tolerance: float
    sample: Callable[[int, int], tuple[System, Problem]]
    model: Callable[[Path], Any]
    planner: type = BiasedRRTConnect
    parameters: dict[str, Any] = field(default_factory=dict)


def arm_problem(seed: int, number: int, start_at_rest: bool = True) -> tuple[System, Problem]:
    """Draw a point for the arm's tip."""
    arm, drawn = PlanarArm(), np.random.SeedSequence([seed, number])
    return arm, arm.sample_reaching_problem(drawn, start_at_rest=start_at_rest)


def arm_problem_from_anywhere(seed: int, number: int) -> tuple[System, Problem]:
    """Draw a point for the tip of an arm that may have to hurry, or else it falls."""
    return arm_problem(seed, number, start_at_rest=False)


def car_problem(seed: int, number: int) -> tuple[System, Problem]:
    """Draw a start and a goal in a random lot, which some other problems share."""
    scene = np.random.SeedSequence([seed, number // PROBLEMS_PER_CAR_SCENE])
    car = Car(random_car_scene(scene))
    return car, car.sample_problem(np.random.SeedSequence([seed, number]))


@cache
def rope_problem(scene: str) -> tuple[System, Problem]:
    """Return the problem of one of the paper's scenes."""
    rope = Rope(scene, features=rope_model(Path()).provenance_["features"])
    return rope, rope.scene_problem()


def simple_hook(seed: int, number: int) -> tuple[System, Problem]:
    """Return the scene's one problem; only planners' seeds differ."""
    return rope_problem("simple_hook")


def engine_assembly(seed: int, number: int) -> tuple[System, Problem]:
    """Return the scene's one problem; only planners' seeds differ."""
    return rope_problem("engine_assembly")


def tractor_problem(seed: int, number: int) -> tuple[System, Problem]:
    """Draw a point to drive to."""
    system = TractorTrailer()
    return system, system.sample_problem(np.random.SeedSequence([seed, number]))


def load_problem(seed: int, number: int) -> tuple[System, Problem]:
    """Draw a place to carry the load to."""
    system = SuspendedLoad()
    return system, system.sample_problem(np.random.SeedSequence([seed, number]))


def arm_model(out: Path) -> Any:
    """Load what ``make arm`` learns."""
    path = out.parent / "arm" / "arm.joblib"
    if not path.exists():
        make_arm(["--queries", "1", "--out", str(path.parent)])
    return load_estimator(path)


def car_model(out: Path) -> Any:
    """Load what ``make car`` learns."""
    path = out.parent / "car" / "car.joblib"
    if not path.exists():
        make_car(["--test-scenes", "1", "--queries", "1", "--out", str(path.parent)])
    return load_estimator(path)


def rope_model(out: Path) -> Any:
    """Load the model that comes with the benchmarks."""
    return load_estimator(COLUMNS["ours"])


def tractor_model(out: Path) -> Any:
    """Learn from the tractor's plans."""
    return own_model(TractorTrailer(), BiasedRRT, out / "tractor")


def load_model(out: Path) -> Any:
    """Learn from the load's plans."""
    return own_model(SuspendedLoad(), BiasedRRTConnect, out / "load")


def own_model(system: System, planner: type, folder: Path) -> Any:
    """Learn from executed plans, as one would for any system, or load what was learned."""
    return learned_classifier(
        folder / "model.joblib",
        system,
        planner(system),
        600,
        data_seed=DATA_SEED,
        classifier_seed=DATA_SEED,
    )


OF_CAR = {"transitions_per_edge": 1, "max_iterations": 8000}
OF_ROPE = {"max_iterations": 10**8, "time_limit": 300.0}
OF_OWN = {"max_iterations": 5000}
SCENARIOS = {
    "arm": Scenario(200, 0.1, arm_problem, arm_model),
    "arm, any start": Scenario(200, 0.1, arm_problem_from_anywhere, arm_model),
    "car": Scenario(100, 0.3, car_problem, car_model, parameters=OF_CAR),
    "simple hook": Scenario(30, 0.025, simple_hook, rope_model, BiasedRRT, OF_ROPE),
    "engine assembly": Scenario(30, 0.025, engine_assembly, rope_model, BiasedRRT, OF_ROPE),
    "tractor": Scenario(100, 0.15, tractor_problem, tractor_model, BiasedRRT, OF_OWN),
    "load": Scenario(100, 0.15, load_problem, load_model, parameters=OF_OWN),
}


@dataclass(frozen=True)
class Trial:
    """A rule on one problem: call it to plan and execute."""

    scenario: str
    estimator: Any
    acceptance: str
    k: float
    seed: int
    number: int

    def __call__(self) -> Item:
        """Return what came of it."""
        scenario = SCENARIOS[self.scenario]
        system, problem = scenario.sample(self.seed, self.number)
        planner = scenario.planner(
            system,
            self.estimator,
            k=self.k,
            acceptance=self.acceptance,
            random_state=self.number,
            **scenario.parameters,
        )
        plan = planner.plan(system.reduce(problem.start), problem.goal)
        return Item(
            {
                "solved": plan.success,
                "succeeded": plan.success
                and succeeds(system, problem, plan.commands, scenario.tolerance),
                "unreliable": plan.success and bool((plan.reliability < 0.5).any()),
                "seconds": plan.planning_time + plan.simplification_time,
                "n_checked": plan.n_checked,
                "n_rejected": plan.n_rejected,
                "n_accepted_unreliable": plan.n_accepted_unreliable,
            }
        )


def main(arguments: list[str] | None = None) -> None:
    """Run the trials that are missing and print a table for each system."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--systems", nargs="+", choices=SCENARIOS, default=list(SCENARIOS))
    parser.add_argument("--problems", type=int, help="of each system; default: as in the docs")
    parser.add_argument("--tuning", action="store_true", help="more settings, other problems")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("build/acceptance"))
    options = parser.parse_args(arguments)
    lines = [
        "| system | acceptance | k | succeeded | solved | with an Unreliable transition "
        "| planning (s) | Unreliable ones accepted |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in options.systems:
        lines += run(name, options)
        print(*lines[-len(TUNED if options.tuning else SETTINGS) :], sep="\n")
    kind = "tuning" if options.tuning else "table"
    options.out.joinpath(f"{kind}.md").write_text("\n".join(lines) + "\n")
    print("", *lines, f"The table is in {options.out}.", sep="\n")


def run(name: str, options: argparse.Namespace) -> list[str]:
    """Return a system's rows of the table."""
    scenario = SCENARIOS[name]
    n_problems = options.problems or scenario.n_problems
    settings = TUNED if options.tuning else SETTINGS
    seed = TUNING_SEED if options.tuning else TEST_SEED
    estimator = scenario.model(options.out)
    system, problem = scenario.sample(seed, 0)
    # Compiled code is loaded on first use, which is no part of planning.
    start = system.reduce(problem.start)
    for acceptance in ("fixed", "temperature"):
        planner = scenario.planner(system, estimator, k=np.inf, acceptance=acceptance)
        planner.plan(start, start[: system.configuration_dim])
    stores = {
        (rule, k): ResumableStore(
            options.out / f"{name.replace(', ', '-').replace(' ', '-')}-{rule}-{k:g}-{seed}",
            "trials of an acceptance rule",
            {
                "estimator": describe(estimator),
                "planner": [scenario.planner.__name__, rule, str(k), scenario.parameters],
                "code": code_digest(type(system)),
            },
        )
        for rule, k in settings
    }
    keys = list(itertools.product(range(n_problems), settings))
    jobs = [
        Job(f"problem-{i:04d}", Trial(name, estimator, *setting, seed, i), stores[setting])
        for i, setting in keys
    ]
    found: dict[tuple[str, float], list[dict[str, Any]]] = {setting: [] for setting in settings}
    for (_, setting), trial in zip(keys, run_jobs(jobs, n_jobs=options.jobs), strict=True):
        found[setting].append(trial.facts)
    return [row(name, *setting, facts) for setting, facts in found.items()]


def row(name: str, acceptance: str, k: float, facts: list[dict[str, Any]]) -> str:
    """Return a line of the table."""
    total = {key: sum(fact[key] for fact in facts) for key in facts[0]}
    asked = total["n_rejected"] + total["n_accepted_unreliable"]
    seconds = [fact["seconds"] for fact in facts]
    cells = (
        name,
        acceptance,
        f"{k:g}",
        str(Share.of(total["succeeded"], len(facts))),
        str(total["solved"]),
        str(total["unreliable"]),
        f"{np.median(seconds):.2g} ({np.mean(seconds):.2g})",
        f"{total['n_accepted_unreliable'] / max(asked, 1):.2%}",
    )
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    main()
