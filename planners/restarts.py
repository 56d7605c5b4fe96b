"""Planning several times, and keeping the plan that is most likely to go well."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from planners.result import PlanResult
from systems.validation import check_count, check_number

_COSTS = (
    "planning_time",
    "simplification_time",
    "n_checked",
    "n_rejected",
    "n_accepted_unreliable",
)


def best_of_restarts(
    attempt: Callable[[int], PlanResult],
    n_plans: int,
    *,
    enough: float = 1.0,
    score: Callable[[PlanResult], float] = lambda plan: plan.success_probability,
) -> PlanResult:
    """Plan again until a plan's score is high enough, and keep the plan of the highest score.

    Parameters
    ----------
    attempt : callable
        Called with 0, 1, 2, ...; plans, with another seed at each call, say.
    n_plans : int
        Plans to make at most.
    enough : float, default=1.0
        No more plans are made after one of at least this score.
    score : callable, default=the plan's ``success_probability``
        Only called with plans that reach the goal: a failure is worse than any of them. A plan
        whose score is NaN counts as a failure.

    Returns
    -------
    plan : PlanResult
        The best of the attempts; its times and counts are those of all of them together.

    Raises
    ------
    ValueError
        If ``n_plans`` is no positive integer or ``enough`` is no number.
    """
    check_count(n_plans, "n_plans")
    check_number(enough, "enough", -np.inf, np.inf)
    plans: list[PlanResult] = []
    scores: list[float] = []
    while not plans or (len(plans) < n_plans and max(scores) < enough):
        plan = attempt(len(plans))
        plans.append(plan)
        scored = score(plan) if plan.success else np.nan
        scores.append(-np.inf if np.isnan(scored) else scored)
    costs = {name: sum(getattr(plan, name) for plan in plans) for name in _COSTS}
    return replace(plans[int(np.argmax(scores))], **costs)
