"""Collecting labelled transitions by executing plans."""

from __future__ import annotations

import copy
import os
import warnings
from collections import Counter
from typing import Any

from reliability.identity import describe_planner
from reliability.item_files import Item
from reliability.plan_execution import (
    DIVERGED,
    FAILED,
    LABELS,
    UNSOLVED,
    Planner,
    PlanTask,
    causes_restored,
    tell_failure,
)
from reliability.scenes import SceneArgument, SceneFamily
from reliability.store import Job, ResumableStore, run_jobs
from reliability.summary import Summary
from reliability.transitions import Transitions, join
from systems.messages import tell
from systems.validation import RandomState, as_seed, check_choice, check_count

_KIND = "transitions of executed plans, one plan in each file"
ON_ERROR = ("raise", "skip")
_MOST_TOLD = 10


def collect_transitions(
    system: SceneArgument,
    planner: Planner,
    n_plans: int,
    *,
    labels: str = "plan",
    on_error: str = "raise",
    n_jobs: int | None = None,
    random_state: RandomState = None,
    path: str | os.PathLike[str] | None = None,
    verbose: int = 0,
) -> Transitions:
    """Plan, execute and label, many times over.

    Each plan has a problem and a planner seed of its own, which follow from ``random_state`` and
    the plan's number alone: from ``SeedSequence(random_state, spawn_key=(number,))``.
    :func:`learn_in_rounds` and :func:`planners.evaluate` have keys of three and two numbers, and so
    other problems for the same ``random_state``. Plans that the planner doesn't solve are left
    out, and so are, with a warning, plans on which the simulator diverges.

    Parameters
    ----------
    system : System, sequence of Systems, or callable ``random_state -> System``
        Where plans are made: in one system; in those of a sequence, which take turns; or each in
        a new one, which the callable makes of an integer and must make again of the same.
    planner : BiasedRRT, BiasedRRTConnect or alike
        A template: for each plan, a copy is given that plan's system and a seed. Without an
        estimator for data as in the paper.
    n_plans : int
    labels : {"plan", "executed", "both"}, default="plan"
        "plan" labels the plan's transitions by Eq. 3 (:func:`label_transitions`); those that the
        execution never came to are left out. "executed" labels each executed command from where
        the true system was when it was given it (:func:`label_executed_transitions`). "both"
        has both for each plan; ``Transitions.executed`` tells them apart.
    on_error : {"raise", "skip"}, default="raise"
        What to do if planning or executing raises an exception: end with the plan's number, seed
        and problem, or leave the plan out, go on, and tell the same in a warning at the end.
    n_jobs : int, default=None
        Processes, or whatever the active joblib backend has; the data do not depend on it.
    random_state : int, Generator, RandomState, SeedSequence or None
    path : path-like, default=None
        Folder in which each plan is kept as soon as it is executed. Call again with the same
        arguments to go on after an interruption, or with a larger ``n_plans`` to have more;
        with a smaller one, only its first plans are read. Several processes may work on one
        folder.
    verbose : int, default=0
        1 shows a progress bar that counts plans, and tells a
        :class:`reliability.summary.Summary`, which can also be drawn, and the first of its
        ``warnings``, if there are any.

    Returns
    -------
    Transitions
        In the order of the plans' numbers, which are their group ids.

    Raises
    ------
    ValueError
        If an argument is unfit, if ``planner`` has a system that is not one of ``system``, or if
        no plan gave a transition.
    StoreError
        A ValueError. If ``path`` holds data that were collected with other arguments, by code of
        the system that has changed, or files that are damaged, swapped or of another folder. The
        message names the file, or what differs.
    PlanFailedError
        If a plan failed and ``on_error`` is "raise".

    References
    ----------
    McConachie et al. 2020, "Data Generation and Labeling".
    """
    items = execute_plans(
        system,
        planner,
        n_plans,
        labels=labels,
        on_error=on_error,
        n_jobs=n_jobs,
        random_state=random_state,
        path=path,
        verbose=verbose,
    )
    return joined(items, verbose)


def execute_plans(
    system: SceneArgument,
    planner: Planner,
    n_plans: int,
    *,
    labels: str,
    on_error: str = "raise",
    n_jobs: int | None,
    random_state: RandomState,
    path: str | os.PathLike[str] | None,
    verbose: int,
) -> list[Item]:
    """Do the work of :func:`collect_transitions`, and return what became of each plan.

    Returns
    -------
    items : list of Item
        One per plan, as :class:`reliability.plan_execution.PlanTask` makes them.
    """
    check_count(n_plans, "n_plans")
    check_choice(labels, "labels", LABELS)
    check_choice(on_error, "on_error", ON_ERROR)
    family = SceneFamily(system)
    family.check_planner(planner)
    seed, store = as_seed(random_state), None
    if path is not None:
        store = _open_store(path, family, planner, labels, seed, adopt=random_state is None)
        seed = store.description["random_state"]
    template = copy.copy(planner)
    template.system = template.random_state = None
    tasks = [
        PlanTask(*_source(family, seed, i), template, labels, on_error, seed, i)
        for i in range(int(n_plans))
    ]
    return _run(tasks, store, n_jobs, verbose)


def _open_store(
    path: str | os.PathLike[str],
    family: SceneFamily,
    planner: Planner,
    labels: str,
    seed: int,
    *,
    adopt: bool,
) -> ResumableStore:
    description = {
        **family.describe(),
        "planner": describe_planner(planner),
        "labels": labels,
        "random_state": seed,
    }
    return ResumableStore(path, _KIND, description, ("random_state",) if adopt else ())


def _source(family: SceneFamily, seed: int, plan: int) -> tuple[Any, int]:
    """Return what a plan's task makes its system of, and the scene's id."""
    scene = family.id_of_plan(plan, seed)
    return family.source(scene), scene


def _run(
    tasks: list[PlanTask], store: ResumableStore | None, n_jobs: int | None, verbose: int
) -> list[Item]:
    jobs = [Job(f"plan-{task.plan:07d}", task, store) for task in tasks]
    with causes_restored():
        items = run_jobs(jobs, n_jobs=n_jobs, verbose=verbose, unit="plan")
        failed = [job for job, item in zip(jobs, items, strict=True) if _has_failed(item)]
        if failed and store is not None and tasks[0].on_error == "raise":
            # An earlier run left these out.
            for job in failed:
                store.discard(job.name)
            items = run_jobs(jobs, n_jobs=n_jobs, verbose=verbose, unit="plan")
    return items


def _has_failed(item: Item) -> bool:
    return bool(item.facts["outcome"] == FAILED)


def joined(items: list[Item], verbose: int) -> Transitions:
    """Return the transitions of all plans, and warn of those that failed or diverged.

    Raises
    ------
    ValueError
        If there is none.
    """
    outcomes = Counter(item.facts["outcome"] for item in items)
    if outcomes[DIVERGED]:
        warnings.warn(
            f"{outcomes[DIVERGED]} of {len(items)} plans were dropped because the simulator "
            "diverged.",
            stacklevel=3,
        )
    failures = [item.facts["failure"] for item in items if _has_failed(item)]
    if failures:
        told = "\n".join(map(tell_failure, failures[:_MOST_TOLD]))
        more = len(failures) - _MOST_TOLD
        warnings.warn(
            f"{len(failures)} of {len(items)} plans failed and were left out.\n{told}"
            + (f"\n… and {more} more." if more > 0 else ""),
            stacklevel=3,
        )
    counts = (
        f"{outcomes[UNSOLVED]} were not solved, {outcomes[DIVERGED]} diverged, {outcomes[FAILED]} "
        "failed."
    )
    parts = [Transitions.from_arrays(item.arrays) for item in items if item.arrays]
    if not sum(map(len, parts)):
        raise ValueError(
            f"None of {len(items)} plans gave a transition: {counts} Give the planner more "
            "iterations, or look at the problems that the system samples."
        )
    transitions = join(parts)
    if verbose:
        summary = Summary.of(transitions)
        tell(f"{summary}\nOf {len(items):,} plans {counts}")
        for warning in summary.warnings[:1]:
            tell(f"Warning: {warning}")
    return transitions
