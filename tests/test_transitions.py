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


NAMES = ("reduced", "command", "next_reduced", "y", "plan", "step")


def arrays_of(transitions):
    return {name: getattr(transitions, name) for name in NAMES}


def assert_equal(one, other):
    for name in NAMES:
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


def band_rows(rng, n_rows, n_points=20):
    """Rows of gripper positions and points, of which the last is repeated."""
    rows = np.zeros((n_rows, 6 + 3 * n_points))
    for row in rows:
        points = rng.normal(size=(rng.integers(2, n_points + 1), 3))
        points = np.vstack([points, np.tile(points[-1], (n_points - len(points), 1))])
        row[:] = [*points[0], *points[-1], *points.ravel()]
    return rows


def test_bands_come_back_bit_by_bit_and_take_little_room(rng, tmp_path):
    plans = [band_rows(rng, 41) for _ in range(5)]
    whole = Transitions.concatenate(
        [
            Transitions(
                rows[:-1],
                np.zeros((40, 6)),
                rows[1:],
                np.ones(40, int),
                np.full(40, i),
                np.arange(40),
            )
            for i, rows in enumerate(plans)
        ]
    )
    before = np.concatenate([rows[:-1] for rows in plans])
    after = np.concatenate([rows[1:] for rows in plans])
    chosen = rng.permutation(200)[:77]
    for some, index in (
        (whole, np.arange(200)),
        (whole[chosen], chosen),
        (whole[::-1], np.s_[::-1]),
    ):
        np.testing.assert_array_equal(some.reduced, before[index])
        np.testing.assert_array_equal(some.next_reduced, after[index])
        some.save(tmp_path / "some.npz")
        assert_equal(Transitions.load(tmp_path / "some.npz"), some)
    assert whole.nbytes < 0.4 * (before.nbytes + after.nbytes)
    assert len(whole[:0].reduced) == 0


@pytest.mark.parametrize("width", [1, 2, 3, 4, 7])
def test_short_rows_come_back(width, rng):
    rows = rng.integers(2, size=(50, width)).astype(float) * -1.0
    parts = Transitions(rows, rows, rows[::-1], *np.zeros((3, 50), int))
    np.testing.assert_array_equal(parts.reduced.view(int), rows.view(int))
    np.testing.assert_array_equal(parts.next_reduced, rows[::-1])


def test_features_are_the_systems(arm, arm_transitions):
    expected = arm.features(arm_transitions.reduced, arm_transitions.next_reduced)
    np.testing.assert_array_equal(arm_transitions.features(arm), expected)


def test_first_mistakes_follow_reliable_transitions_of_the_same_plan():
    y = np.array([1, 0, 0, 0, 1, 0, 1])
    plan = np.array([0, 0, 0, 1, 1, 1, 2])
    step = np.array([0, 1, 2, 0, 1, 2, 0])
    zeros = np.zeros((7, 1))
    first = Transitions(zeros, zeros, zeros, y, plan, step).divergence_onsets()
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
    with pytest.raises(ValueError, match=r"format version 99 .* reads 2; make"):
        Transitions.load(tmp_path / "new.npz")
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    with pytest.raises(ValueError, match="not a whole file of transitions"):
        Transitions.load(tmp_path / "other.npz")
    with pytest.raises(FileNotFoundError):
        Transitions.load(tmp_path / "absent.npz")


def test_arrays_that_do_not_fit_are_refused(transitions):
    with pytest.raises(ValueError, match="y must have a row per transition, 6, got 5"):
        Transitions(**arrays_of(transitions) | {"y": transitions.y[:5]})
    with pytest.raises(ValueError, match="command must be an array of 2 dimensions"):
        Transitions(**arrays_of(transitions) | {"command": transitions.y})


def test_labels_are_one_and_zero():
    assert (RELIABLE, UNRELIABLE) == (1, 0)


def test_what_plans_did_long_after_they_went_wrong_for_good_is_left_out():
    y = np.array([1, 0, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0])
    plan = np.array([7, 7, 7, 7, 7, 7, 3, 5, 5, 5, 2, 2])
    step = np.array([0, 1, 2, 3, 4, 5, 0, 0, 1, 2, 0, 1])
    order = np.random.default_rng(0).permutation(len(y))
    rows = np.arange(12.0)[order, None]
    data = Transitions(rows, rows, rows, y[order], plan[order], step[order])
    for n_after, left_out in ((1, [4, 5, 9, 11]), (2, [5])):
        kept = data.trim_unreliable_tail(n_after).reduced[:, 0]
        np.testing.assert_array_equal(np.sort(kept), np.delete(np.arange(12), left_out))
    all_reliable = data[data.y == RELIABLE]
    assert len(all_reliable.trim_unreliable_tail(1)) == len(all_reliable)
    assert len(data[:0].trim_unreliable_tail(1)) == 0
    with pytest.raises(ValueError, match="n_after must be"):
        data.trim_unreliable_tail(0)
