"""Transitions: selection, joining and files."""

import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from toy_systems import Disc

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


NAMES = ("reduced", "command", "next_reduced", "y", "plan", "step", "scene", "executed")


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


def test_parts_join_end_to_end_and_their_plans_stay_apart(transitions):
    plan = {"plan": [10, 10, 12, 12, 13, 20]}
    other = Transitions(**arrays_of(transitions) | plan)
    joined = Transitions.concatenate([transitions, other, transitions, transitions[3:]])
    assert joined.plan.tolist() == [
        *[0, 0, 0, 4, 4, 5],
        *[10, 10, 12, 12, 13, 20],
        *[21, 21, 21, 22, 22, 23],
        *[24, 24, 25],
    ]
    for name in set(NAMES) - {"plan"}:
        column = getattr(transitions, name)
        expected = np.concatenate([column, column, column, column[3:]])
        np.testing.assert_array_equal(getattr(joined, name), expected)
    assert transitions.plan.tolist() == [0, 0, 0, 4, 4, 5], "parts stay as they are"
    with pytest.raises(ValueError, match="at least one"):
        Transitions.concatenate([])


def sizes_of(ids):
    return sorted(np.unique(ids, return_counts=True)[1].tolist())


def random_transitions(seed, sizes, width, first_plan=0, whole_numbers=False):
    """Plans of the given numbers of transitions; each begins where the one before ended."""
    rng = np.random.default_rng(seed)
    parts = []
    for i, n in enumerate(sizes):
        states = rng.integers(2, size=(n + 1, width)) * 1.0
        states *= 1 if whole_numbers else rng.normal(size=(n + 1, 1))
        parts.append(
            Transitions(
                states[:-1],
                rng.normal(size=(n, 2)),
                states[1:],
                rng.integers(2, size=n),
                np.full(n, first_plan + 3 * i),
                np.arange(n),
                np.full(n, i % 2),
                rng.random(n) < 0.5,
            )
        )
    return Transitions.concatenate(parts)


shapes = st.fixed_dictionaries(
    {
        "seed": st.integers(0, 99),
        "sizes": st.lists(st.integers(0, 6), min_size=1, max_size=5),
        "width": st.integers(1, 9),
        "whole_numbers": st.booleans(),
    }
)
often = settings(derandomize=True, deadline=None, max_examples=80)


@given(shapes, st.data())
@often
def test_any_selection_of_any_transitions_is_that_of_their_columns(shape, data):
    some = random_transitions(**shape)
    n = len(some)
    rows = data.draw(
        st.slices(n)
        | npst.arrays(bool, n)
        | st.lists(st.integers(0, max(n - 1, 0)), max_size=2 * n).map(lambda i: np.array(i, int))
    )
    chosen = some[rows]
    for name in NAMES:
        np.testing.assert_array_equal(getattr(chosen, name), getattr(some, name)[rows])
    again = data.draw(st.slices(len(chosen)))
    assert_equal(chosen[again], some[np.arange(n)[rows][again]])


@given(st.lists(shapes, min_size=1, max_size=3), st.integers(0, 5))
@often
def test_any_parts_join_without_two_plans_becoming_one(parts, first_plan):
    made = [random_transitions(**shape, first_plan=first_plan) for shape in parts]
    joined = Transitions.concatenate(made)
    assert len(joined) == sum(map(len, made))
    assert sizes_of(joined.plan) == sorted(size for part in made for size in sizes_of(part.plan))
    begin = 0
    for part in made:
        rows = joined[begin : begin + len(part)]
        begin += len(part)
        assert np.array_equal(rows.scene, part.scene)
        assert np.array_equal(rows.divergence_onsets()[1:], part.divergence_onsets()[1:])
        if len(part):
            width = part.reduced.shape[1]
            np.testing.assert_array_equal(rows.reduced, part.reduced)
            np.testing.assert_array_equal(rows.next_reduced[:, :width], part.next_reduced)


@given(shapes)
@often
def test_any_transitions_come_back_from_a_file_bit_by_bit(tmp_path_factory, shape):
    path = tmp_path_factory.getbasetemp() / "any.npz"
    some = random_transitions(**shape)
    some.save(path)
    loaded = Transitions.load(path)
    assert_equal(loaded, some)
    assert loaded.reduced.tobytes() == some.reduced.tobytes()
    assert [getattr(loaded, name).dtype for name in NAMES] == [
        getattr(some, name).dtype for name in NAMES
    ]


def test_scenes_of_different_dimensions_go_together(tmp_path):
    narrow = random_transitions(0, [4], 5)
    wide = random_transitions(1, [3], 8)
    wide.scene[:] = 1

    class Scene(Disc):
        def features(self, reduced, next_reduced):
            assert reduced.shape[1] == self.reduced_dim
            return np.column_stack([reduced.sum(axis=1), next_reduced.sum(axis=1)])

    small, large = Scene(), Scene()
    small.reduced_dim, large.reduced_dim = 5, 8
    joined = Transitions.concatenate([narrow, wide, narrow])
    joined.save(tmp_path / "some.npz")
    for some in (joined, Transitions.load(tmp_path / "some.npz")):
        assert some.reduced.shape == (11, 8)
        np.testing.assert_array_equal(some.reduced[:4, :5], narrow.reduced)
        np.testing.assert_array_equal(some.reduced[:4, 5:], narrow.reduced[:, 2:5])
        np.testing.assert_array_equal(some[some.scene == 0][:4].reduced, narrow.reduced)
        expected = np.concatenate([part.reduced.sum(axis=1) for part in (narrow, wide, narrow)])
        np.testing.assert_array_equal(some.features([small, large])[:, 0], expected)
    assert "reduced_dim 5 to 8" in repr(joined)


def test_they_say_what_they_are(transitions):
    assert repr(transitions) == (
        "<Transitions: 6 transitions of 3 plans in 1 scene, 50.0% Unreliable, reduced_dim 3, "
        "command_dim 2>"
    )
    assert "1 transition of 1 plan in" in repr(transitions[:1])
    assert repr(transitions[:0]) == "<Transitions: none, reduced_dim 3>"


@pytest.mark.parametrize("y", [[2, 1], ["a", "b"], [0.5, 1.0]])
def test_what_could_not_be_loaded_is_not_saved(transitions, tmp_path, y):
    changed = transitions[:2]
    changed.y = np.array(y)
    with pytest.raises(ValueError, match="y must"):
        changed.save(tmp_path / "data.npz")
    assert not list(tmp_path.iterdir())


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


def test_divergence_onsets_follow_reliable_transitions_of_the_same_plan():
    y = np.array([1, 0, 0, 0, 1, 0, 1])
    plan = np.array([0, 0, 0, 1, 1, 1, 2])
    step = np.array([0, 1, 2, 0, 1, 2, 0])
    zeros = np.zeros((7, 1))
    first = Transitions(zeros, zeros, zeros, y, plan, step).divergence_onsets()
    assert first.tolist() == [False, True, False, True, False, True, False]
    executed = np.array([False, False, False, True, True, True, True])
    data = Transitions(zeros, zeros, zeros, 0 * y, plan, step, executed=executed)
    assert data.divergence_onsets().tolist() == [True, False, False, True, True, True, True]
    mixed = Transitions(
        zeros[:2], zeros[:2], zeros[:2], y[1:3], plan[:2], step[:2], None, np.array([True, False])
    )
    assert mixed.divergence_onsets().all(), "neither follows a transition of its own kind"


def test_rows_labelled_from_executed_states_are_kept():
    zeros, y = np.zeros((8, 1)), np.array([1, 0, 0, 0, 1, 0, 0, 0])
    executed = np.repeat([False, True], 4)
    data = Transitions(zeros, zeros, zeros, y, 0 * y, np.tile(np.arange(4), 2), None, executed)
    kept = data.trim_unreliable_runs(1)
    assert kept.step.tolist() == [0, 1, 0, 1, 2, 3]


@pytest.mark.parametrize("kept", [0, 10, 500, -40])
def test_truncated_files_are_refused(transitions, tmp_path, kept):
    path = tmp_path / "some.npz"
    transitions.save(path)
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(ValueError, match="not a whole file of transitions"):
        Transitions.load(path)


def test_files_of_another_version_or_kind_are_refused(transitions, tmp_path):
    np.savez(tmp_path / "new.npz", format_version=np.array(99))
    with pytest.raises(ValueError, match=r"format version 99 .* reads 3; make"):
        Transitions.load(tmp_path / "new.npz")
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    with pytest.raises(ValueError, match="not a whole file of transitions"):
        Transitions.load(tmp_path / "other.npz")
    with pytest.raises(FileNotFoundError):
        Transitions.load(tmp_path / "absent.npz")


@pytest.mark.parametrize("position", range(30, 3000, 270))
def test_a_flipped_bit_is_noticed(transitions, tmp_path, position):
    path = tmp_path / "some.npz"
    transitions.save(path)
    content = bytearray(path.read_bytes())
    content[position] ^= 1
    path.write_bytes(content)
    assert is_same_or_refused_by_name(path, transitions)


def is_same_or_refused_by_name(path, transitions):
    """Load a file; some bits, as those of time stamps, are none of the transitions."""
    try:
        loaded = arrays_of(Transitions.load(path))
    except ValueError as error:
        return str(path) in str(error)
    return all(np.array_equal(loaded[name], getattr(transitions, name)) for name in NAMES)


CHANGES = {
    "y": lambda y: 1 - y,
    "plan": lambda plan: plan[:-1],
    "width": lambda width: width + 1,
    "command": lambda command: command * 2,
}


@pytest.mark.parametrize("name", CHANGES)
def test_files_whose_arrays_were_changed_are_refused(transitions, tmp_path, name):
    path = tmp_path / "some.npz"
    transitions.save(path)
    arrays = dict(np.load(path))
    np.savez(path, **arrays | {name: CHANGES[name](arrays[name])})
    with pytest.raises(ValueError, match="was changed after it had been written") as caught:
        Transitions.load(path)
    assert str(path) in str(caught.value)


def test_arrays_that_claim_more_than_the_file_holds_are_not_made_room_for(transitions, tmp_path):
    path = tmp_path / "some.npz"
    transitions.save(path)
    content = path.read_bytes()
    shape = b"'shape': (6,), }    "
    assert shape in content
    path.write_bytes(content.replace(shape, b"'shape': (10**12,), }"[: len(shape)]))
    with pytest.raises(ValueError, match="not a whole file of transitions"):
        Transitions.load(path)
    header = b"\x93NUMPY\x01\x00\x76\x00{'descr': '<f8', 'fortran_order': False, 'shape': (%d,), }"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("values.npy", (header % 10**12).ljust(127) + b"\n")
    with pytest.raises(ValueError, match="claims to hold 8000000000000 bytes and does not"):
        Transitions.load(path)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("values.npy", b"\0" * 10**6)
    with pytest.raises(ValueError, match="would be larger than the file's"):
        Transitions.load(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": np.array(10**6)}, "widths must be between 1 and 100000"),
        ({"width": np.array([3])}, "width must be an array of int64 with 0 dimensions"),
        ({"widths": np.full(12, 2, np.int32)}, "lengths must be between"),
        ({"lengths": np.full(12, 2, np.int32)}, "lengths must be between"),
        ({"lengths": np.full(3, 3, np.int32)}, "widths must be as many as lengths, 3, got 12"),
        ({"lengths": np.zeros((3, 3), np.int32)}, "lengths must be an array of int32 with 1"),
        ({"values": np.zeros(5)}, "values must hold the"),
        ({"values": np.zeros(5, np.float32)}, "values must be an array of float64"),
        ({"first": np.full(6, 11)}, "first must number states of 12 that another follows"),
        ({"first": np.full(6, -1)}, "first must number states of 12 that another follows"),
        ({"first": np.zeros(6)}, "first must hold integers"),
        ({"plan": np.zeros(5, int)}, r"plan must have the shape \(6,\), got \(5,\)"),
        ({"y": np.full(6, 2)}, "y must hold 1 for Reliable and 0"),
        ({"command": np.zeros((5, 2))}, "command must have the shape"),
        ({"scene": np.zeros(6)}, "scene must hold integers"),
    ],
)
def test_arrays_that_do_not_belong_together_are_refused(transitions, change, message):
    arrays = transitions.to_arrays()
    assert len(arrays["lengths"]) == 12, "no transition begins where another ends"
    with pytest.raises(ValueError, match=message):
        Transitions.from_arrays(arrays | change)


def test_arrays_that_do_not_fit_are_refused(transitions):
    for change, message in (
        ({"y": transitions.y[:5]}, r"y must have the shape \(6,\), got \(5,\)"),
        ({"command": transitions.y}, "command must have the shape"),
        ({"next_reduced": np.zeros((6, 2))}, r"next_reduced must have the shape \(6, 3\)"),
        ({"reduced": np.full((6, 3), np.nan)}, "reduced must be finite"),
        ({"reduced": np.array([["a"] * 3] * 6)}, "reduced must be an array of numbers"),
        ({"command": np.array([[None, {}]] * 6)}, "command must be an array of numbers"),
        ({"executed": np.ones(6, int)}, "executed must hold 6 bools"),
        ({"scene": np.zeros(5, int)}, "scene must have the shape"),
        ({"reduced": np.zeros((6, 100_001)), "next_reduced": np.zeros((6, 100_001))}, "at most"),
    ):
        with pytest.raises(ValueError, match=message):
            Transitions(**arrays_of(transitions) | change)


@pytest.mark.parametrize(
    "y",
    [
        [-1, 1, 1, 1, -1, 1],
        [2, 1, 2, 2, 1, 1],
        [0.3, 0.9, 1.0, 0.0, 1.0, 0.0],
        [0, 1, 0, 1, 0, np.nan],
        ["reliable"] * 6,
        [None, 1, 0, 1, 0, 1],
    ],
)
def test_labels_in_another_coding_are_refused(transitions, y):
    with pytest.raises(ValueError, match="y must hold"):
        Transitions(**arrays_of(transitions) | {"y": np.array(y)})


@pytest.mark.parametrize("name", ["plan", "step", "scene"])
def test_ids_that_are_no_integers_are_refused(transitions, name):
    for ids in (np.array([None] * 6), np.full(6, np.nan), np.array(["a"] * 6), np.ones(6)):
        with pytest.raises(ValueError, match=f"{name} must hold integers"):
            Transitions(**arrays_of(transitions) | {name: ids})


def test_labels_are_one_and_zero():
    assert (RELIABLE, UNRELIABLE) == (1, 0)


def test_what_plans_did_long_after_they_diverged_is_left_out():
    y = np.array([1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0])
    plan = np.array([7, 7, 7, 7, 7, 7, 7, 3, 5, 5, 5, 2, 2])
    step = np.array([0, 1, 2, 3, 4, 5, 6, 0, 0, 1, 2, 0, 1])
    rows = np.arange(13.0)[:, None]
    data = Transitions(rows, rows, rows, y, plan, step)
    for n_after, left_out in ((1, [2, 5, 6, 10, 12]), (2, [6])):
        kept = data.trim_unreliable_runs(n_after)
        np.testing.assert_array_equal(kept.reduced[:, 0], np.delete(np.arange(13), left_out))
    onsets = data[(data.y == RELIABLE) | data.divergence_onsets()]
    assert_equal(data.trim_unreliable_runs(1), onsets)
    all_reliable = data[data.y == RELIABLE]
    assert len(all_reliable.trim_unreliable_runs(1)) == len(all_reliable)
    assert len(data[:0].trim_unreliable_runs(1)) == 0
    with pytest.raises(ValueError, match="n_after must be"):
        data.trim_unreliable_runs(0)
