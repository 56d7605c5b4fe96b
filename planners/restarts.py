"""Planning several times, and keeping the plan that is most likely to go well."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from planners.result import PlanResult
from systems.validation import check_count, check_number, is_number

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

    For scores and ways of planning of one's own. To plan again until a planner's plan is at least
    as likely to go well as ``min_success``, give the planner ``restarts``.

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
        If ``n_plans`` is no positive integer, ``enough`` is no number, or ``score`` returns none.
    """
    check_count(n_plans, "n_plans")
    check_number(enough, "enough", -np.inf, np.inf)
    return best_until_enough((attempt(number) for number in range(n_plans)), enough, score)


def best_until_enough(
    plans: Iterable[PlanResult], enough: float, score: Callable[[PlanResult], float]
) -> PlanResult:
    """Take plans until one of them scores enough, and return the best with the costs of all."""
    made: list[PlanResult] = []
    scores: list[float] = []
    for plan in plans:
        made.append(plan)
        scored = score(plan) if plan.solved else np.nan
        if not is_number(scored):
            raise ValueError(f"score must return a number, got {scored!r}.")
        scores.append(-np.inf if np.isnan(scored) else scored)
        if scores[-1] >= enough:
            break
    costs = {name: sum(getattr(plan, name) for plan in made) for name in _COSTS}
    return replace(made[int(np.argmax(scores))], **costs)
