"""Transitions: selection, joining and files."""

import numpy as np
import pytest

from reliability import RELIABLE, UNRELIABLE, Transitions


@pytest.fixture
def transitions(rng):
    return Transitions(
        reduced=rng.normal(size=(6, 3)),
        command=rng.normal(size=(6, 2)),
        next_reduced=rng.normal(size=(6, 3)),
        y=np.array([1, 0, 0, 1, 0, 1]),
        plan=np.array([0, 0, 0, 4, 4, 5]),
        step=np.array([0, 1, 2, 0, 1, 0]),
    )


def assert_equal(one, other):
    for name in vars(one):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize("rows", [slice(1, 4), np.array([5, 0]), np.arange(6) % 2 == 0, [2, 3]])
def test_rows_are_selected_together(transitions, rows):
    selected = transitions[rows]
    np.testing.assert_array_equal(selected.reduced, transitions.reduced[rows])
    np.testing.assert_array_equal(selected.step, transitions.step[rows])
    assert len(selected) == len(np.arange(6)[rows])


def test_a_single_row_is_refused(transitions):
    with pytest.raises(IndexError, match="slice, mask or array"):
        transitions[2]


def test_parts_join_to_the_whole(transitions):
    assert_equal(Transitions.concatenate([transitions[:2], transitions[2:]]), transitions)
    with pytest.raises(ValueError, match="at least one"):
        Transitions.concatenate([])


def test_files_give_back_what_was_saved(transitions, tmp_path):
    transitions.save(tmp_path / "some.npz")
    assert_equal(Transitions.load(tmp_path / "some.npz"), transitions)
    assert [path.name for path in tmp_path.iterdir()] == ["some.npz"]


def test_features_are_the_systems(arm, arm_transitions):
    expected = arm.features(arm_transitions.reduced, arm_transitions.next_reduced)
    np.testing.assert_array_equal(arm_transitions.features(arm), expected)


def test_first_mistakes_follow_reliable_transitions_of_the_same_plan():
    y = np.array([1, 0, 0, 0, 1, 0, 1])
    plan = np.array([0, 0, 0, 1, 1, 1, 2])
    step = np.array([0, 1, 2, 0, 1, 2, 0])
    zeros = np.zeros((7, 1))
    first = Transitions(zeros, zeros, zeros, y, plan, step).first_mistakes()
    assert first.tolist() == [False, True, False, True, False, True, False]


@pytest.mark.parametrize("kept", [0, 10, 500, -40])
def test_truncated_files_are_refused(transitions, tmp_path, kept):
    path = tmp_path / "some.npz"
    transitions.save(path)
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(ValueError, match="not a whole file of transitions"):
        Transitions.load(path)


def test_files_of_another_version_or_kind_are_refused(transitions, tmp_path):
    np.savez(tmp_path / "new.npz", format_version=np.array(99))
    with pytest.raises(ValueError, match=r"format version 99 .* reads 1; make"):
        Transitions.load(tmp_path / "new.npz")
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    with pytest.raises(ValueError, match="not a whole file of transitions"):
        Transitions.load(tmp_path / "other.npz")
    with pytest.raises(FileNotFoundError):
        Transitions.load(tmp_path / "absent.npz")


def test_arrays_that_do_not_fit_are_refused(transitions):
    with pytest.raises(ValueError, match="y must have a row per transition, 6, got 5"):
        Transitions(**vars(transitions) | {"y": transitions.y[:5]})
    with pytest.raises(ValueError, match="command must be an array of 2 dimensions"):
        Transitions(**vars(transitions) | {"command": transitions.y})


def test_labels_are_one_and_zero():
    assert (RELIABLE, UNRELIABLE) == (1, 0)
