"""Labels follow Eq. 3."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reliability import RELIABLE, UNRELIABLE, label_executed_transitions, label_transitions


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


def advance(reduced, command):
    """Predict that a command is carried out, except beyond 10."""
    following = reduced + command
    return np.where(following < 10, following, np.nan), following[:, 0] < 10


def label_executed(executed, commands):
    found = label_executed_transitions(
        np.array(executed, float)[:, None], np.array(commands, float)[:, None], advance, near
    )
    return [column.ravel().tolist() for column in found]


def test_commands_that_did_what_g_predicts_are_reliable():
    reduced, following, y, step = label_executed([0, 1, 2, 4], [1, 1, 2])
    assert (reduced, following) == ([0, 1, 2], [1, 2, 4])
    assert y == [RELIABLE] * 3
    assert step == [0, 1, 2]


def test_labels_from_executed_states_begin_anew_at_each():
    """Where Eq. 3 has one Reliable transition and three after a divergence, here one is bad."""
    executed, commands = [0, 1, 1.5, 2.5, 3.5], [1, 1, 1, 1]
    reduced, following, y, _ = label_executed(executed, commands)
    assert reduced == [0, 1, 1.5, 2.5]
    assert following == [1, 2, 2.5, 3.5]
    assert y == [RELIABLE, UNRELIABLE, RELIABLE, RELIABLE]
    assert label([0, 0, -0.5, -0.5, -0.5]) == [RELIABLE] + [UNRELIABLE] * 3


def test_commands_that_were_not_given_have_no_label_and_a_boundary_state_is_judged_by_close():
    reduced, _, y, step = label_executed([0, 1, 1.95], [1, 1, 1, 1])
    assert (reduced, y, step) == ([0, 1], [RELIABLE] * 2, [0, 1])
    assert label_executed([0, 1, 1.5], [1, 1, 1, 1])[2] == [RELIABLE, UNRELIABLE]
    assert label_executed([0], [1, 1]) == [[], [], [], []]


def test_commands_that_g_does_not_allow_where_the_system_is_are_left_out():
    reduced, following, y, step = label_executed([7, 9.5, 9.6, 9.7], [2, 1, 0.1])
    assert (reduced, following) == ([7, 9.6], [9, 9.7])
    assert y == [UNRELIABLE, RELIABLE]
    assert step == [0, 2]


@given(st.lists(st.tuples(st.integers(1, 3), st.booleans()), max_size=8), st.integers(0, 3))
def test_labels_from_executed_states_equal_their_definition_written_out(moves, n_left):
    executed = np.cumsum([0.0, *(by + (0 if well else 0.5) for by, well in moves)])
    commands = [float(by) for by, _ in moves] + [1.0] * n_left
    reduced, following, y, step = label_executed(executed, commands)
    allowed = [t for t, (by, _) in enumerate(moves) if executed[t] + by < 10]
    assert step == allowed
    assert reduced == executed[allowed].tolist()
    assert following == [executed[t] + commands[t] for t in allowed]
    assert y == [RELIABLE if moves[t][1] else UNRELIABLE for t in allowed]


@pytest.mark.parametrize(
    ("executed", "commands", "propagate", "close", "message"),
    [
        ([0.0], [[1.0]], advance, near, "executed must have the shape"),
        ([[0.0], [np.inf]], [[1.0]], advance, near, "executed must be finite"),
        ([[0.0], [1.0]], [1.0], advance, near, "commands must have the shape"),
        ([[0.0], [1.0]], np.empty((0, 1)), advance, near, "between 1 and 1 states, one more than"),
        (np.empty((0, 1)), [[1.0]], advance, near, "executed must have between 1 and 2 states"),
        (
            [[0.0], [1.0]],
            [[1.0]],
            lambda b, u: (b + u, True),
            near,
            "propagate must return one bool",
        ),
        (
            [[0.0], [1.0]],
            [[1.0]],
            lambda b, u: (np.full_like(b, np.nan), np.ones(1, bool)),
            near,
            "propagate's successors must be finite",
        ),
        ([[0.0], [1.0]], [[1.0]], advance, lambda p, e: True, "close must return one bool per row"),
    ],
)
def test_bad_executions_are_refused(executed, commands, propagate, close, message):
    with pytest.raises(ValueError, match=message):
        label_executed_transitions(executed, commands, propagate, close)
