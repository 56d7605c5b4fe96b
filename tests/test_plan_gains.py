"""The t-test over plans, and what it says where there is no spread to compare gains with."""

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from reliability.plan_gains import gains_of_plans, p_value
from reliability.round_report import is_better


def test_rows_of_a_plan_are_added_up_wherever_they_stand():
    gains = gains_of_plans(np.array([1.0, 2.0, 4.0, 8.0]), ["b", "a", "b", "c"])
    assert gains.tolist() == [2, 5, 8]


@pytest.mark.parametrize("alternative", ["two-sided", "greater"])
def test_gains_that_differ_are_tested_against_none(rng, alternative):
    gains = rng.normal(0.3, 1, 20)
    assert p_value(gains, alternative) == ttest_1samp(gains, 0, alternative=alternative).pvalue
    assert p_value(-gains, alternative) != p_value(gains, "greater")


@pytest.mark.parametrize("gain", [-2, 0, 2])
@pytest.mark.parametrize("n_plans", [1, 5])
def test_equal_gains_are_as_the_alternative_says_or_not(gain, n_plans):
    gains = np.full(n_plans, float(gain))
    assert p_value(gains) == (gain == 0)
    assert p_value(gains, "greater") == (gain <= 0)


def test_a_balanced_accuracy_that_all_plans_raise_alike_is_not_called_better():
    y, none = np.array([0, 1, 0, 1]), np.zeros(4, dtype=bool)
    assert not is_better(~none, none, y, np.array([0, 0, 1, 1]))
    assert not is_better(~none, none, y, np.zeros(4, dtype=int))
    gained = np.tile(~none, 10)
    gained[1] = False
    plan = np.repeat(np.arange(20), 2)
    assert is_better(gained, np.zeros(40, dtype=bool), np.tile(y, 10), plan)
