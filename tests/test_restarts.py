"""Planning several times: which plan is kept, when it stops, and what it cost."""

import numpy as np
import pytest

from planners import PlanResult, PlanStatus, best_of_restarts


def plan_of(*reliability, status=PlanStatus.SOLVED, seed=0):
    n = len(reliability)
    return PlanResult(
        reduced=np.zeros((n + 1, 2)),
        commands=np.zeros((n, 2)),
        status=status,
        reliability=np.array(reliability, dtype=float),
        planning_time=1.0,
        simplification_time=0.5,
        n_checked=10,
        n_rejected=2,
        n_accepted_unreliable=1,
        tree=np.zeros((0, 2, 2)),
        random_state=seed,
    )


PLANS = [
    plan_of(status=PlanStatus.ITERATION_LIMIT, seed=0),
    plan_of(0.5, 0.5, seed=1),
    plan_of(0.9, 0.8, seed=2),
    plan_of(0.99, 0.99, seed=3),
]


@pytest.mark.parametrize(("enough", "kept", "made"), [(0.2, 1, 2), (0.7, 2, 3), (1.0, 3, 4)])
def test_it_stops_at_a_plan_that_is_likely_enough(enough, kept, made):
    result = best_of_restarts(PLANS.__getitem__, 4, enough=enough)
    assert result.random_state == kept
    assert result.success_probability == pytest.approx(np.prod(PLANS[kept].reliability))
    costs = (result.planning_time, result.simplification_time, result.n_checked)
    assert costs == (made, 0.5 * made, 10 * made)
    assert (result.n_rejected, result.n_accepted_unreliable) == (2 * made, made)


def test_any_plan_is_better_than_none_and_no_plan_is_a_result():
    assert best_of_restarts([PLANS[0], plan_of(0.0, seed=7)].__getitem__, 2).random_state == 7
    failed = best_of_restarts(lambda i: PLANS[0], 3)
    assert not failed.success
    assert failed.success_probability == 0.0
    assert failed.planning_time == 3.0


def test_a_distrusted_plan_is_better_than_none():
    plans = [PLANS[0], plan_of(0.3, status=PlanStatus.DISTRUSTED, seed=1), plan_of(0.2, seed=2)]
    kept = best_of_restarts(plans.__getitem__, 3)
    assert (kept.random_state, kept.status) == (1, PlanStatus.DISTRUSTED)


def test_a_plan_without_a_score_is_not_kept():
    plans = [plan_of(0.9, np.nan, seed=0), plan_of(0.1, seed=1), plan_of(np.nan, seed=2)]
    assert best_of_restarts(plans.__getitem__, 3).random_state == 1


@pytest.mark.parametrize("score", ["good", None, [0.5]])
def test_a_score_is_a_number(score):
    with pytest.raises(ValueError, match="score must return a number, got"):
        best_of_restarts(lambda i: plan_of(0.5, seed=i), 2, score=lambda plan: score)


def test_the_score_is_the_callers():
    plans = [plan_of(0.1, 0.9, seed=0), plan_of(0.5, 0.8, seed=1)]
    last = best_of_restarts(plans.__getitem__, 2, score=lambda plan: plan.reliability[-1])
    assert last.random_state == 0
    assert best_of_restarts(plans.__getitem__, 2).random_state == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n_plans": 0}, "n_plans must be"),
        ({"n_plans": 2, "enough": "all"}, "enough must be"),
    ],
)
def test_bad_arguments_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        best_of_restarts(lambda i: PLANS[0], **arguments)
