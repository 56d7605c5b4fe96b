"""Labels follow Eq. 3."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reliability import RELIABLE, UNRELIABLE, label_transitions


def near(predicted, executed):
    return np.abs(predicted - executed).max(axis=1) < 0.1


def label(gaps):
    """Label a plan whose execution is off by ``gaps``, one per executed state."""
    predicted = np.arange(5.0)[:, None]
    executed = predicted[: len(gaps)] + np.array(gaps)[:, None]
    return label_transitions(predicted, executed, near).tolist()


def test_close_before_and_after_is_reliable():
    assert label([0, 0.05, -0.05, 0, 0]) == [RELIABLE] * 4


def test_close_then_far_is_unreliable():
    assert label([0, 0, 0, 0, 1]) == [RELIABLE, RELIABLE, RELIABLE, UNRELIABLE]


def test_far_then_close_is_unreliable():
    assert label([1, 0, 0, 0, 0]) == [UNRELIABLE, RELIABLE, RELIABLE, RELIABLE]


def test_far_before_and_after_is_unreliable():
    assert label([0, 1, 1, 0, 0]) == [UNRELIABLE, UNRELIABLE, UNRELIABLE, RELIABLE]


def test_transitions_after_a_truncated_execution_are_unreliable():
    assert label([0, 0, 0]) == [RELIABLE, RELIABLE, UNRELIABLE, UNRELIABLE]
    assert label([0]) == [UNRELIABLE] * 4


def test_a_boundary_state_is_judged_by_close_alone():
    assert label([0, 0, 0.05]) == [RELIABLE, RELIABLE, UNRELIABLE, UNRELIABLE]
    assert label([0, 0, 0.5]) == [RELIABLE, UNRELIABLE, UNRELIABLE, UNRELIABLE]


def test_a_plan_of_one_state_has_no_labels():
    assert label_transitions([[0.0]], [[0.0]], near).shape == (0,)


@given(st.lists(st.booleans(), min_size=1, max_size=12), st.integers(0, 5))
def test_labels_equal_the_equation_written_out(closeness, n_unexecuted):
    predicted = np.arange(len(closeness) + n_unexecuted, dtype=float)[:, None]
    executed = predicted[: len(closeness)] + np.where(closeness, 0.0, 1.0)[:, None]
    padded = closeness + [False] * n_unexecuted
    expected = [
        RELIABLE if padded[t] and padded[t + 1] else UNRELIABLE for t in range(len(padded) - 1)
    ]
    assert label_transitions(predicted, executed, near).tolist() == expected


@pytest.mark.parametrize(
    ("predicted", "executed", "close", "message"),
    [
        ([0.0, 1.0], [[0.0]], near, "predicted must have the shape"),
        ([[0.0], [1.0]], [[0.0, 0.0]], near, "executed must have the shape"),
        ([[0.0], [np.nan]], [[0.0]], near, "predicted must be finite"),
        ([[0.0]], [[0.0], [1.0]], near, "executed must have between 1 and 1 states"),
        ([[0.0]], np.empty((0, 1)), near, "executed must have between 1 and 1 states"),
        ([["a"]], [[0.0]], near, "predicted must be an array of numbers"),
        ([[0.0]], [[0.0]], lambda p, e: True, "close must return one bool per row"),
        ([[0.0]], [[0.0]], lambda p, e: np.zeros(1), "close must return one bool per row"),
    ],
)
def test_bad_input_is_refused(predicted, executed, close, message):
    with pytest.raises(ValueError, match=message):
        label_transitions(predicted, executed, close)
