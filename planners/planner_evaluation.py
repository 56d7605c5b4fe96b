"""Planning and executing on problems that nobody has seen, to count what goes well."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from planners.carrying_out import check_max_replans, execute
from planners.evaluation import Evaluation
from planners.execution import Execution
from planners.kept_plan import item_of, plan_of
from reliability.identity import describe_planner
from reliability.item_files import Item
from reliability.plan_execution import PlanFailedError, causes_restored
from reliability.scenes import SceneArgument, SceneFamily, plan_seeds
from reliability.store import Job, ResumableStore, run_jobs
from systems.messages import tell
from systems.system import System
from systems.validation import RandomState, as_seed, check_count, check_number

_KIND = "a planner's first plans and executions of unseen problems, one problem in each file"
# No collection has a plan of this number, so that none has these seeds.
_PURPOSE = (2**32 - 1,)


def evaluate(
    system: SceneArgument,
    planner: Any,
    n_problems: int,
    *,
    tolerance: float,
    max_replans: int = 0,
    n_jobs: int | None = None,
    random_state: RandomState = None,
    path: str | os.PathLike[str] | None = None,
    verbose: int = 0,
) -> Evaluation:
    """Plan and execute on unseen problems, and count what goes well.

    Problems, scenes that a callable makes, and the planner's seeds follow from ``random_state``
    and the problem's number alone: from ``SeedSequence(random_state, spawn_key=(2**32 - 1,
    number))``. :func:`reliability.collect_transitions` spawns with ``(number,)``, so that an
    evaluation has other problems than a collection with the same ``random_state``. All planners
    get the same problems: evaluate each with the same ``random_state``, and see
    :meth:`Evaluation.compare`.

    Parameters
    ----------
    system : System, sequence of Systems, or callable ``random_state -> System``
        As in :func:`reliability.collect_transitions`: one system; several, which take turns; or
        what makes a new one of an integer for each problem.
    planner : BiasedRRT, BiasedRRTConnect or alike
        A template: for each problem, a copy is given that problem's system and a seed.
    n_problems : int
    tolerance : float
        How near to the goal the true state has to come, as :meth:`systems.System.succeeded`
        takes it.
    max_replans : int, default=0
        Plans that may be made after the first of each problem, where the system leaves it; see
        :func:`execute`.
    n_jobs : int, default=None
        Processes, or whatever the active joblib backend has. Only times depend on it.
    random_state : int, Generator, RandomState, SeedSequence or None
    path : path-like, default=None
        Folder in which each problem's outcome is kept as soon as it is known. Call again with the
        same arguments to go on after an interruption, or with a larger ``n_problems``.
    verbose : int, default=0
        1 shows a progress bar, and tells the table.

    Returns
    -------
    Evaluation
        In the order of the problems' numbers. That the simulator diverges is a failure with a
        status of its own.

    Raises
    ------
    ValueError
        If an argument is unfit, or ``planner`` has a system that is not one of ``system``.
    StoreError
        A ValueError. If ``path`` holds outcomes for other arguments, or damaged files.
    PlanFailedError
        If the planner, the system or drawing a problem raised an exception; tells the problem's
        number, the planner's seed and the problem.

    Examples
    --------
    >>> from planners import BiasedRRTConnect, evaluate
    >>> from systems import PlanarArm
    >>> arm = PlanarArm()
    >>> evaluation = evaluate(arm, BiasedRRTConnect(arm), 10, tolerance=0.1, random_state=0)
    >>> evaluation.n_solved
    10
    """
    check_count(n_problems, "n_problems")
    check_number(tolerance, "tolerance", 0, np.inf)
    check_max_replans(max_replans)
    family = SceneFamily(system)
    family.check_planner(planner)
    seed, store = as_seed(random_state), None
    if path is not None:
        description = {
            **family.describe(),
            "planner": describe_planner(planner),
            "tolerance": float(tolerance),
            "max_replans": int(max_replans),
            "random_state": seed,
        }
        adopted = ("random_state",) if random_state is None else ()
        store = ResumableStore(path, _KIND, description, adopted)
        seed = store.description["random_state"]
    template = copy.copy(planner)
    template.system = template.random_state = None
    scenes = [family.id_of_plan(i, seed, _PURPOSE) for i in range(int(n_problems))]
    tasks = [
        _Task(family.source(scene), scene, template, float(tolerance), int(max_replans), seed, i)
        for i, scene in enumerate(scenes)
    ]
    jobs = [Job(f"problem-{task.number:07d}", task, store) for task in tasks]
    with causes_restored():
        items = run_jobs(jobs, n_jobs=n_jobs, verbose=verbose, unit="problem")
    outcomes = [
        {**item.facts["outcome"], "plans": plan_of(Item(item.facts["plan"], item.arrays))}
        for item in items
    ]
    evaluation = Evaluation.of(outcomes, float(tolerance), int(max_replans), seed)
    if verbose:
        tell(str(evaluation))
    return evaluation


@dataclass(frozen=True)
class _Task:
    """Plans and executes one problem; all that is random follows from its number and the seed."""

    source: System | Callable[[int], System]
    scene: int
    planner: Any
    tolerance: float
    max_replans: int
    seed: int
    number: int

    def __call__(self) -> Item:
        problem_seed, planner_seed, _ = plan_seeds(self.seed, self.number, _PURPOSE)
        planner, problem = copy.copy(self.planner), None
        planner.random_state = int(planner_seed.generate_state(1)[0])
        try:
            system = SceneFamily(self.source).system(self.scene)
            problem = system.sample_problem(problem_seed)
            execution = execute(
                system,
                planner,
                problem,
                tolerance=self.tolerance,
                max_replans=self.max_replans,
            )
        except Exception as error:
            raise PlanFailedError.of(
                error, self.number, self.scene, planner.random_state, problem
            ) from error
        plan = item_of(execution.plans[0])
        outcome = {"scene": self.scene, **_outcome(execution)}
        return Item({"outcome": outcome, "plan": plan.facts}, plan.arrays)


def _outcome(execution: Execution) -> dict[str, Any]:
    plan, stop_reason = execution.plans[0], execution.stop_reason
    return {
        "solved": bool(plan.success),
        "status": execution.status.name,
        "stop_reason": None if stop_reason is None else str(stop_reason.value),
        "planning_time": execution.planning_time,
        "n_transitions": len(plan.commands),
        "n_replans": execution.n_replans,
        "success_probability": float(getattr(plan, "success_probability", np.nan)),
    }
