"""Clearance features: against a plain reference, and what they do not depend on."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra.numpy import arrays
from rope_states import band_points, pbd_nodes, resample_bands
from scipy.integrate import quad
from scipy.optimize import brentq

from planners import BiasedRRT
from systems import Box, Rope, Scene, check_system
from systems.rope.band.band import band_length, reduced_dim
from systems.rope.features.clearance import clearance_features, mirrored, reversed_ends
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.slack.pbd_ropes import KINDS, pbd_dim

N_COLUMNS, N_ROWS, DEPTH = 16, 8, 1.2
N_CELLS = N_COLUMNS * N_ROWS
ENDS = np.array([[0.5, -0.3, 0.0], [0.5, 0.3, 0.0]])
BEFORE, AFTER, HANGING, PBD = np.cumsum([0, 4, 4, N_CELLS])


def states_of(rope, seed=0):
    start = rope.reduce(rope.scene_problem().start)
    planner = BiasedRRT(rope, max_iterations=3000, simplify=False, random_state=seed)
    result = planner.plan(start, rope.scene.goal.ravel())
    tree = result.reduced
    return tree[:-1], tree[1:]


def bend_of(width, rise, length):
    """Solve for b such that rise / width * s - b * s * (width - s) has a length."""

    def excess(bend):
        def speed(s):
            return np.hypot(1.0, rise / width - bend * (width - 2 * s))

        return quad(speed, 0.0, width, limit=200)[0] - length

    return brentq(excess, 0.0, 1e4) if excess(0.0) < 0 else 0.0


def parts_of(row, scene):
    width = reduced_dim(scene)
    return row[:width], pbd_nodes(row[width:], row[:6])


def reference_hanging(band, scene):
    points = band_points(band)
    shadow = np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(shadow)])
    width, rise = travelled[-1], points[-1, 2] - points[0, 2]
    at = (np.arange(N_COLUMNS) + 0.5) / N_COLUMNS
    on_band = np.column_stack([np.interp(at * width, travelled, column) for column in points.T])
    bend = bend_of(width, rise, scene.rope_length)
    sag = bend * width**2 * at * (1 - at)
    share = DEPTH * np.arange(1, N_ROWS + 1) / N_ROWS
    samples = np.repeat(on_band[:, None], N_ROWS, axis=1)
    samples[..., 2] -= sag[:, None] * share
    return in_units(samples, scene), bend * width**2 / 4


def in_units(samples, scene):
    distances = signed_distance(samples.reshape(-1, 3), scene.packed)
    return np.clip(distances, -0.05, 0.15) / 0.05


def reference_pbd(band, nodes, scene):
    at = (np.arange(N_COLUMNS) + 0.5) / N_COLUMNS
    fractions = np.linspace(0.0, 1.0, len(nodes))
    on_rope = np.column_stack([np.interp(at, fractions, column) for column in nodes.T])
    on_band = resample_bands(band[None], 2 * N_COLUMNS + 1)[0, 1::2]
    way = on_rope - on_band
    share = DEPTH * np.arange(1, N_ROWS + 1) / N_ROWS
    samples = on_band[:, None] + share[:, None] * way[:, None]
    along = (band[3:5] - band[:2]) / np.linalg.norm(band[3:5] - band[:2])
    turned = np.column_stack(
        [way[:, :2] @ along, way[:, :2] @ np.array([-along[1], along[0]]), way[:, 2]]
    )
    length = np.linalg.norm(np.diff(nodes, axis=0), axis=1).sum()
    share_of_limit = length / scene.max_band_length
    return np.concatenate([in_units(samples, scene), turned.ravel() / 0.05, [share_of_limit]])


@pytest.mark.parametrize("name", ["simple_hook", "engine_assembly"])
def test_it_agrees_with_a_plain_reference(name):
    rope = Rope(name, features="clearance")
    before, after = (rows[::12] for rows in states_of(rope))
    rows = rope.features(before, after)
    assert rows.shape == (len(before), 496)
    for states, first in ((before, BEFORE), (after, AFTER)):
        for i, state in enumerate(states):
            band, _ = parts_of(state, rope.scene)
            expected, depth = reference_hanging(band, rope.scene)
            lengths = [
                np.linalg.norm(state[3:6] - state[:3]),
                band_length(band[None])[0],
                state[5] - state[2],
                depth,
            ]
            shares = np.divide(lengths, rope.scene.rope_length)
            np.testing.assert_allclose(rows[i, first : first + 4], shares, atol=1e-5)
            if first == AFTER:
                np.testing.assert_allclose(rows[i, HANGING:PBD], expected, atol=1e-4)
    for i, state in enumerate(after):
        band, ropes = parts_of(state, rope.scene)
        expected = np.hstack([reference_pbd(band, nodes, rope.scene) for nodes in ropes])
        np.testing.assert_allclose(rows[i, PBD:-6], expected, atol=1e-4)


def test_a_bar_below_the_band_is_seen_where_it_is():
    bar = Box((0.0, 0.0, -0.1), (0.5, 0.02, 0.02), "bar")
    grippers = np.array([[0.0, -0.3, 0.0], [0.0, 0.3, 0.0]])
    away = grippers + np.array([0.7, 0.0, 0.0])
    scene = Scene([bar], np.array([[-1, -1, -1], [1, 1, 1]]), 0.8, away, grippers)
    band = np.concatenate([grippers.ravel(), grippers.ravel()])
    filled = np.tile(grippers[1], (reduced_dim(scene) - 12) // 3)
    row = np.concatenate([band, filled, np.zeros(pbd_dim(scene))])[None]
    cells = clearance_features(row, row, scene)[0, HANGING:PBD].reshape(N_COLUMNS, N_ROWS)
    inside = np.argwhere(cells < 0)
    assert set(inside[:, 0]) == {7, 8}, "the bar crosses the middle of the band"
    assert 0 < inside[:, 1].min() <= inside[:, 1].max() < N_ROWS - 1, "and hangs above the rope"


def test_turning_the_world_changes_nothing():
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    shift = np.array([0.3, -0.2, 0.1])
    bar = Box((0.1, 0.05, -0.1), (0.3, 0.02, 0.04))
    turned_bar = Box(tuple(turn @ bar.center + shift), (0.02, 0.3, 0.04))
    ends = np.array([[0.7, -0.3, 0.0], [0.7, 0.3, 0.1]])
    box = np.array([[-2.0] * 3, [2.0] * 3])
    scene = Scene([bar], box, 0.8, ends, ends - np.array([1.4, 0.0, 0.0]))
    turned = Scene([turned_bar], box, 0.8, ends @ turn.T + shift, ends @ turn.T + shift)
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.3, 0.3, size=(40, n_points(scene), 3))
    points[:, 4:] = points[:, 3:4]
    ropes = rng.uniform(-0.3, 0.3, size=(40, len(KINDS), scene.n_nodes - 2, 3))
    rows = (
        rows_of_points(points, ropes),
        rows_of_points(points @ turn.T + shift, ropes @ turn.T + shift),
    )
    here, there = (states.reshape(20, 2, -1) for states in rows)
    np.testing.assert_allclose(
        clearance_features(here[:, 0], here[:, 1], scene),
        clearance_features(there[:, 0], there[:, 1], turned),
        atol=1e-4,
    )


def n_points(scene):
    return (reduced_dim(scene) - 6) // 3


def rows_of_points(points, ropes):
    ends = points[:, [0, -1]].reshape(len(points), 6)
    at_rest = np.stack([ropes, np.zeros_like(ropes)], axis=2)
    return np.hstack([part.reshape(len(points), -1) for part in (ends, points, at_rest)])


def test_symmetries_are_those_of_the_world():
    bars = [Box((0.1, 0.05, -0.1), (0.3, 0.02, 0.04)), Box((-0.2, -0.1, 0.1), (0.02, 0.1, 0.02))]
    across = [Box((bar.center[0], -bar.center[1], bar.center[2]), bar.half_extents) for bar in bars]
    ends = np.array([[0.9, -0.3, 0.0], [0.9, 0.3, 0.1]])
    world = np.array([[-2.0] * 3, [2.0] * 3])
    scene, mirror_scene = (
        Scene(parts, world, 0.8, ends, ends - np.array([1.8, 0, 0])) for parts in (bars, across)
    )
    rng = np.random.default_rng(1)
    before = rng.uniform(-0.3, 0.3, size=(20, n_points(scene), 3))
    after = before + rng.uniform(-0.01, 0.01, size=before.shape)
    ropes = rng.uniform(-0.3, 0.3, size=(20, len(KINDS), scene.n_nodes - 2, 3))
    X = clearance_features(rows_of_points(before, ropes), rows_of_points(after, ropes), scene)
    back = (before[:, ::-1].copy(), after[:, ::-1].copy(), ropes[:, :, ::-1].copy())
    other_before, other_after, other_ropes = back
    other_way = clearance_features(
        rows_of_points(other_before, other_ropes), rows_of_points(other_after, other_ropes), scene
    )
    exchanged = reversed_ends(X)
    np.testing.assert_allclose(exchanged, other_way, atol=2e-3)
    flip = np.array([1.0, -1.0, 1.0])
    image = clearance_features(
        rows_of_points(before * flip, ropes * flip),
        rows_of_points(after * flip, ropes * flip),
        mirror_scene,
    )
    np.testing.assert_allclose(mirrored(X), image, atol=1e-4)


def test_the_rope_with_clearance_features_is_a_system():
    check_system(Rope(features="clearance"))


@settings(max_examples=30, deadline=None, derandomize=True)
@given(arrays(np.float32, (3, 496), elements=st.floats(-3.0, 3.0, width=32)))
def test_twice_mirrored_or_twice_reversed_is_as_before(X):
    np.testing.assert_array_equal(mirrored(mirrored(X)), X)
    np.testing.assert_array_equal(reversed_ends(reversed_ends(X)), X)
    both = reversed_ends(mirrored(X))
    np.testing.assert_array_equal(mirrored(reversed_ends(X)), both)
    changed = (mirrored(X) != X).any(axis=0)
    assert changed.sum() <= 2 * 16 + 2, "sideways offsets and motions, and nothing else"
    assert both.dtype == X.dtype
    assert mirrored(X[:0]).shape == reversed_ends(X[:0]).shape == (0, 496)


def test_grippers_above_one_another_have_features_too():
    scene = Scene([], np.array([[-2.0] * 3, [2.0] * 3]), 0.8, ENDS, ENDS)
    above = np.array([[0.0, 0.0, 0.3], [0.0, 0.0, -0.1]])
    points = np.tile(above[1], (n_points(scene), 1))
    points[0] = above[0]
    nodes = np.linspace(*above, scene.n_nodes)[1:-1]
    row = rows_of_points(points[None], np.tile(nodes, (1, len(KINDS), 1, 1)))
    after = row + 0.0
    after[:, :3] += (0.01, 0.0, 0.0)
    X = clearance_features(row, after, scene)
    assert np.isfinite(X).all()
    np.testing.assert_allclose(X[0, BEFORE : BEFORE + 3], np.array([0.4, 0.4, -0.4]) / 0.8)
    assert X[0, BEFORE + 3] > 0.0, "the rope hangs below"
    np.testing.assert_allclose(X[0, -6:], [0.4, 0.0, 0.0, 0.0, 0.0, 0.0], atol=1e-6)
    np.testing.assert_array_equal(X[:, HANGING:PBD], 3.0)


def test_bad_rows_are_refused():
    scene = Scene([], np.array([[-2.0] * 3, [2.0] * 3]), 0.8, ENDS, ENDS)
    rows = np.zeros((2, reduced_dim(scene) + pbd_dim(scene)))
    for before, after, message in (
        (rows[:, 1:], rows, "reduced must have the shape"),
        (rows, rows[:1], "next_reduced must have the shape"),
        (rows, rows + np.nan, "next_reduced must be finite"),
    ):
        with pytest.raises(ValueError, match=message):
            clearance_features(before, after, scene)
