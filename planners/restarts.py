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
    """Plan until a plan is likely enough to go well, and keep the likeliest.

    Parameters
    ----------
    attempt : callable
        Plans for the 0th, 1st, 2nd... time; with another seed each time, say.
    n_plans : int
        Plans to make at most.
    enough : float, default=1.0
        A plan of this score is kept without looking for a better one.
    score : callable, default=the plan's ``success_probability``
        Never asked about a failure: that is worse than any plan.

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
    merits: list[float] = []
    while not plans or (len(plans) < n_plans and max(merits) < enough):
        plan = attempt(len(plans))
        plans.append(plan)
        merits.append(score(plan) if plan.success else -np.inf)
    costs = {name: sum(getattr(plan, name) for plan in plans) for name in _COSTS}
    return replace(plans[int(np.argmax(merits))], **costs)
