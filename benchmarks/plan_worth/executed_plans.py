"""Plans for problems that no classifier has learned from, and whether they went well."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.plan_worth.measured_systems import SYSTEMS
from benchmarks.shared_steps import succeeds
from planners import PlanResult
from reliability import Item, Job, ResumableStore, describe, run_jobs

PROBLEM_SEED = 16
# Scenes of these numbers are not those that training data come from.
FIRST_SCENE = 1_000_000


@dataclass(frozen=True)
class Outcome:
    """A plan, distrusted or not, and what became of it.

    Attributes
    ----------
    plan : PlanResult
    succeeded : bool
        Whether its execution came within the tolerance of the goal.
    """

    plan: PlanResult
    succeeded: bool


@dataclass(frozen=True)
class ExecutedPlan:
    """Plans and executes one problem; all that is random follows from its number."""

    name: str
    planner: Any
    number: int
    plan_file: Path

    def __call__(self) -> Item:
        """Plan and execute once, and keep the plan in a file."""
        measured = SYSTEMS[self.name]
        system = measured.system(FIRST_SCENE + self.number)
        problem = measured.problem(system, np.random.SeedSequence([PROBLEM_SEED, self.number]))
        planner = copy.copy(self.planner).set_params(system=system, random_state=self.number)
        plan = planner.plan(system.reduce(problem.start), problem.goal)
        plan.save(self.plan_file)
        succeeded = plan.solved and succeeds(system, problem, plan.commands, measured.tolerance)
        return Item({"succeeded": succeeded})


def executed_plans(
    name: str, planner: Any, numbers: range, folder: Path, n_jobs: int
) -> list[Outcome]:
    """Plan and execute problems, or read what was done before."""
    store = ResumableStore(folder, "executed plans", {"planner": describe(planner)})
    files = [folder / f"plan-{number:05d}.npz" for number in numbers]
    jobs = [
        Job(f"problem-{number:05d}", ExecutedPlan(name, planner, number, file), store)
        for number, file in zip(numbers, files, strict=True)
    ]
    items = run_jobs(jobs, n_jobs=n_jobs, verbose=1, unit="plan")
    return [
        Outcome(PlanResult.load(file), bool(item.facts["succeeded"]))
        for file, item in zip(files, items, strict=True)
    ]
