"""The elastic band, checked against slow references and for what must hold of any motion."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from rope_states import band_points, plain_resample, polyline_length, resample_bands

from systems import Rope, Scene
from systems.errors import SimulationDivergedError
from systems.rope.band.band import (
    CLOSE_DISTANCE,
    N_MATCHED,
    band_length,
    bands_close,
    reduce_rope,
    reduced_dim,
)
from systems.rope.band.chain_kernels import CLEARANCE
from systems.rope.band.comparison_kernels import compare_bands
from systems.rope.obstacles.shapes import Box, Cylinder
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.paper_scenes import SCENE_NAMES, load_scene
from systems.rope.scene import GRIPPER_CLEARANCE

STEP = 0.025
# Where two bubbles of the smallest size meet, so much is free between them.
FREE = 0.0005
# A band may cut corners that the reference, which keeps the clearance all along, goes around.
CUT = 0.004

seeds = st.integers(0, 2**32 - 1)


def start_band(scene):
    return reduce_rope(scene.start_rope(), scene.start, scene)[None]


def random_motion(scene, rng, n_steps):
    """Bands along straight gripper motions that g allows, and the commands."""
    rope = Rope(scene)
    low, high = scene.bounds[0] + GRIPPER_CLEARANCE, scene.bounds[1] - GRIPPER_CLEARANCE
    rows, commands = [start_band(scene)], []
    for _ in range(100 * n_steps):
        target = rng.uniform(low, high, (2, 3)).ravel()
        for _ in range(rng.integers(1, 40)):
            way = target - rows[-1][0, :6]
            if np.linalg.norm(way) < 1e-6:
                break
            command = way * min(1.0, STEP / np.linalg.norm(way))
            following, valid = rope.propagate(rows[-1], command[None])
            if not valid[0]:
                break
            rows.append(following)
            commands.append(command)
            if len(commands) == n_steps:
                return np.concatenate(rows), np.array(commands)
    raise AssertionError("The motion got stuck.")


def homotopic(rows, others, scene):
    """Whether no obstacle is between matched points, however far apart they are."""
    return compare_bands(rows, others, scene.packed, N_MATCHED, np.inf)


def pillars(rope_length=0.76):
    """Two posts as high as the world, so that a band cannot get over them."""
    return Scene(
        obstacles=[
            Box((0.0, 0.15, 0.0), (0.05, 0.05, 1.0)),
            Cylinder((0.15, -0.15, 0.0), 0.06, 1.0),
        ],
        bounds=[[-0.5, -0.5, -0.2], [0.5, 0.5, 0.2]],
        rope_length=rope_length,
        start=[[-0.3, 0.35, 0.0], [-0.3, -0.35, 0.0]],
        goal=[[0.4, 0.3, 0.0], [0.4, -0.3, 0.0]],
    )


def empty_scene():
    return Scene(
        [], [[-1.0] * 3, [1.0] * 3], 0.76, [[0, 0.3, 0], [0, -0.3, 0]], [[0.5, 0, 0], [0, 0, 0]]
    )


def plain_gradient(points, packed):
    h = 1e-7 * np.eye(3)
    ahead, behind = (signed_distance(points[:, None] + side, packed) for side in (h, -h))
    gradient = ahead - behind
    return gradient / np.maximum(np.linalg.norm(gradient, axis=1, keepdims=True), 1e-300)


def plain_contraction(points, scene, n=160, n_sweeps=12000):
    """Relax a densely sampled curve all at once, in steps too small to jump over anything."""
    points = plain_resample(points, n)
    for sweep in range(n_sweeps):
        if sweep % 50 == 0:
            points = plain_resample(points, n)
        way = 0.5 * (points[:-2] + points[2:]) - points[1:-1]
        inner = points[1:-1] + way
        depth = CLEARANCE - signed_distance(inner, scene.packed)
        touching = depth > 0.0
        inner[touching] += depth[touching, None] * plain_gradient(inner[touching], scene.packed)
        points[1:-1] = inner
    return points


def drape(scene, *corners):
    """A rope along straight pieces, with as many nodes as the scene's has."""
    return plain_resample(np.array(corners, dtype=float), scene.n_nodes)


HOOKED = [(-0.3, 0.3, -0.02), (-0.3, 0.04, -0.12), (-0.3, -0.04, -0.12), (-0.3, -0.3, -0.02)]
OVER_HOOK = [(-0.3, 0.25, -0.15), (-0.3, 0.0, 0.1), (-0.3, -0.25, -0.15)]
AROUND_PILLAR = [(-1.1, 0.3, 0.0), (-0.9, 0.3, 0.0), (-0.9, 0.1, 0.1), (-1.1, 0.1, 0.1)]
THROUGH_SLIT = [(0.2, 0.2, 0.05), (0.3, 0.2, 0.0), (0.5, 0.2, 0.0), (0.6, 0.1, 0.2)]


@pytest.mark.parametrize("corners", [HOOKED, OVER_HOOK, AROUND_PILLAR, THROUGH_SLIT])
def test_r_finds_the_shortest_curve_that_a_plain_relaxation_finds(corners):
    scene = load_scene("simple_hook")
    nodes = drape(scene, *corners)
    reduced = reduce_rope(nodes, nodes[[0, -1]], scene)
    expected = plain_contraction(nodes, scene)
    assert -CUT < band_length(reduced[None])[0] - polyline_length(expected) < 3e-3
    matched = resample_bands(reduced[None])[0] - plain_resample(expected, 500)
    assert np.linalg.norm(matched) < 0.7 * CLOSE_DISTANCE


@pytest.mark.parametrize("seed", range(4))
def test_g_finds_the_shortest_curve_that_a_plain_relaxation_finds(seed):
    scene = pillars()
    rows, _ = random_motion(scene, np.random.default_rng(seed), 60)
    for before, after in zip(rows[40::10], rows[41::10], strict=False):
        dragged = np.vstack([after[:3], band_points(before), after[3:6]])
        expected = plain_contraction(dragged, scene, n_sweeps=6000)
        assert -CUT < band_length(after[None])[0] - polyline_length(expected) < 3e-3


def test_a_rope_under_the_hook_is_reduced_to_a_band_under_the_hook():
    scene = load_scene("simple_hook")
    nodes = drape(scene, *HOOKED)
    under = reduce_rope(nodes, nodes[[0, -1]], scene)[None]
    above = reduce_rope(nodes[[0, -1]] + (0.0, 0.0, 1e-9), nodes[[0, -1]], scene)[None]
    middle = resample_bands(under)[0, 250]
    assert middle[2] == pytest.approx(-0.075 - CLEARANCE, abs=5e-3)
    assert band_length(above)[0] == pytest.approx(0.6, abs=1e-3)
    assert not homotopic(under, above, scene)[0]
    assert not bands_close(under, above, scene)[0]


@pytest.mark.parametrize("name", SCENE_NAMES)
def test_a_band_never_enters_an_obstacle(name):
    scene = load_scene(name)
    rows, _ = random_motion(scene, np.random.default_rng(5), 250)
    points = resample_bands(rows, 1500)
    assert signed_distance(points, scene.packed).min() > FREE
    np.testing.assert_array_equal(points[:, 0], rows[:, :3])
    np.testing.assert_allclose(points[:, -1], rows[:, 3:6], atol=1e-12)
    assert (band_length(rows) <= scene.max_band_length).all()


@given(seeds, st.sampled_from(("simple_hook_short", "multi_hook", "engine_assembly")))
@settings(deadline=None, max_examples=15)
def test_a_band_never_gets_longer_while_its_ends_stay(seed, name):
    scene = load_scene(name)
    rows, _ = random_motion(scene, np.random.default_rng(seed), 60)
    stayed, valid = Rope(scene).propagate(rows, np.zeros((len(rows), 6)))
    assert valid.all()
    assert (band_length(stayed) <= band_length(rows) + 1e-12).all()
    assert (norm_of_differences(stayed, rows) < CLOSE_DISTANCE).mean() > 0.95


@given(seeds)
@settings(deadline=None, max_examples=25)
def test_in_free_space_a_band_is_the_straight_line(seed):
    scene = empty_scene()
    rng = np.random.default_rng(seed)
    rows, _ = random_motion(scene, rng, 30)
    apart = np.linalg.norm(rows[:, 3:6] - rows[:, :3], axis=1)
    np.testing.assert_allclose(band_length(rows), apart, atol=1e-9)
    loop = rng.uniform(-0.2, 0.2, (39, 3))
    straight = reduce_rope(loop, loop[[0, -1]], scene)
    expected = np.linalg.norm(loop[-1] - loop[0])
    assert band_length(straight[None])[0] == pytest.approx(expected, abs=1e-9)


@given(seeds)
@settings(deadline=None, max_examples=25)
def test_going_around_obstacles_and_back_returns_to_the_start(seed):
    scene = pillars(rope_length=1.0)
    rows, commands = random_motion(scene, np.random.default_rng(seed), 60)
    rope, back = Rope(scene), rows[-1:]
    for command in -commands[::-1]:
        following, valid = rope.propagate(back, command[None])
        if not valid[0]:  # a hair's breadth from overstretched on the way out
            return
        back = following
    assert band_length(back)[0] == pytest.approx(band_length(rows[:1])[0], abs=1e-3)
    assert homotopic(back, rows[:1], scene)[0]


def turn_around(points, center):
    """Angle by which a curve turns around a vertical axis."""
    x, y = (points[:, :2] - center).T
    return np.unwrap(np.arctan2(y, x))[-1] - np.arctan2(y[0], x[0])


@given(seeds)
@settings(deadline=None, max_examples=25)
def test_a_band_stays_in_its_homotopy_class_over_random_motions(seed):
    scene = pillars(rope_length=1.4)
    rows, _ = random_motion(scene, np.random.default_rng(seed), 250)
    bands = resample_bands(rows, 2000)
    for center in ((0.0, 0.15), (0.15, -0.15)):
        turns = np.array([turn_around(band, center) for band in bands])
        # Angles of the grippers add up without jumps, so the band's turn must follow them.
        first, last = turn_path(rows[:, :3], center), turn_path(rows[:, 3:6], center)
        np.testing.assert_allclose(turns - turns[0], last - first, atol=1e-6)


def turn_path(points, center):
    x, y = (points[:, :2] - center).T
    angles = np.unwrap(np.arctan2(y, x))
    return angles - angles[0]


@pytest.mark.parametrize("name", SCENE_NAMES)
def test_a_band_gets_longer_by_no_more_than_its_ends_move(name):
    scene = load_scene(name)
    rows, commands = random_motion(scene, np.random.default_rng(3), 150)
    moved = np.linalg.norm(commands.reshape(-1, 2, 3), axis=2).sum(axis=1)
    assert (np.diff(band_length(rows)) <= moved + 1e-9).all()
    # Only where it slips off an obstacle's end does a band sweep over one in a single step.
    assert homotopic(rows[1:], rows[:-1], scene).mean() > 0.97


def test_rows_are_propagated_each_on_its_own_and_always_alike():
    scene = load_scene("engine_assembly")
    rows, commands = random_motion(scene, np.random.default_rng(0), 50)
    together, valid = Rope(scene).propagate(rows[:-1], commands)
    assert valid.all()
    np.testing.assert_array_equal(together, rows[1:])


def test_a_band_that_would_be_overstretched_has_no_successor():
    rope = Rope("simple_hook_short")
    reduced, limit = start_band(rope.scene), rope.scene.max_band_length
    apart = np.linalg.norm(reduced[0, 3:6] - reduced[0, :3])
    for longer, expected in ((1e-6, False), (-1e-6, True)):
        pulled = np.array([[0.0, 0.0, 0.0, 0.0, apart - limit - longer, 0.0]])
        following, valid = rope.propagate(reduced, pulled)
        assert valid[0] == expected
        np.testing.assert_array_equal(following[:, :6], reduced[:, :6] + expected * pulled)


def test_a_caught_band_is_overstretched_before_its_ends_are_that_far_apart():
    rope = Rope(pillars())
    reduced, valid = start_band(rope.scene), np.array([True])
    while valid[0]:
        reduced, valid = rope.propagate(reduced, np.array([[STEP, 0, 0, STEP, 0, 0]]) / 2)
    assert np.linalg.norm(reduced[0, 3:6] - reduced[0, :3]) == pytest.approx(0.7, abs=1e-9)
    assert reduced[0, 0] < 0.4
    assert 0.99 * rope.scene.max_band_length < band_length(reduced)[0]


def test_a_gripper_in_an_obstacle_has_no_successor():
    scene = pillars()
    near = np.array([[-0.08, 0.15, 0.0], [-0.3, -0.35, 0.0]])
    reduced = reduce_rope(near, near, scene)[None]
    for end in (0, 3):
        command = np.zeros((1, 6))
        command[0, end] = 0.05 if end == 0 else 0.4
        command[0, end + 1] = 0.0 if end == 0 else 0.2
        following, valid = Rope(scene).propagate(reduced, command)
        assert not valid[0]
        np.testing.assert_array_equal(following, reduced)


def norm_of_differences(rows, others):
    """The paper's D."""
    differences = resample_bands(rows) - resample_bands(others)
    return np.linalg.norm(differences.reshape(len(rows), -1), axis=1)


def test_lengths_and_resampling_match_the_plain_formulas():
    scene = load_scene("multi_hook")
    rows, _ = random_motion(scene, np.random.default_rng(1), 60)
    lengths = [polyline_length(band_points(row)) for row in rows]
    np.testing.assert_allclose(band_length(rows), lengths, atol=1e-12)
    for row, sampled in zip(rows, resample_bands(rows, 100), strict=True):
        np.testing.assert_allclose(sampled, plain_resample(band_points(row), 100), atol=1e-9)


def test_homotopy_is_what_a_fine_sampling_of_the_ways_between_says():
    scene = load_scene("engine_assembly")
    rows, _ = random_motion(scene, np.random.default_rng(8), 300)
    rng = np.random.default_rng(0)
    i, j = rng.integers(0, len(rows), (2, 120))
    j[:60] = np.minimum(i[:60] + 4, len(rows) - 1)
    ratio = np.linspace(0.0, 1.0, 200)[:, None, None]
    answers = homotopic(rows[i], rows[j], scene)
    near = norm_of_differences(rows[i], rows[j]) < CLOSE_DISTANCE
    np.testing.assert_array_equal(bands_close(rows[i], rows[j], scene), answers & near)
    for answer, p, q in zip(answers, resample_bands(rows[i]), resample_bands(rows[j]), strict=True):
        nearest = signed_distance(p + ratio * (q - p), scene.packed).min()
        if abs(nearest) > 1e-3:
            assert answer == (nearest > 0.0)
    assert 0.1 < answers.mean() < 0.9


def test_close_bands_differ_by_half_a_metre_over_five_hundred_points():
    scene = empty_scene()
    line = np.array([[0.0, 0.3, 0.0], [0.0, -0.3, 0.0]])
    shifts = np.array([0.0, 0.999, 1.001, -1.001]) * CLOSE_DISTANCE / np.sqrt(500)
    lines = line + shifts[:, None, None] * np.array([1.0, 0.0, 0.0])
    bands = [reduce_rope(shifted, shifted, scene) for shifted in lines]
    close = bands_close(np.array([bands[0]] * 4), np.array(bands), scene)
    assert close.tolist() == [True, True, False, False]


def test_a_slack_loop_around_a_bar_is_not_cut():
    scene = Scene(
        [Box((0.0, 0.0, 0.0), (0.02, 0.02, 2.0))],
        [[-1.0] * 3, [1.0] * 3],
        0.76,
        [[-0.5, 0.35, 0.0], [-0.5, -0.35, 0.0]],
        [[0.5, 0.2, 0.0], [0.5, -0.2, 0.0]],
    )
    # The rope comes from x = -0.3, goes around the bar at a distance and returns.
    angles = np.linspace(np.pi - 0.3, -np.pi + 0.3, 40)
    nodes = 0.3 * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    reduced = reduce_rope(nodes, nodes[[0, -1]], scene)
    assert turn_around(resample_bands(reduced[None], 2000)[0], (0.0, 0.0)) < -np.pi


@pytest.mark.parametrize(
    ("nodes", "grippers", "error", "words"),
    [
        (np.full((5, 3), np.nan), np.zeros((2, 3)), ValueError, "nodes must be finite"),
        (np.zeros((5, 2)), np.zeros((2, 3)), ValueError, r"nodes must have the shape \(any, 3\)"),
        (np.zeros((5, 3)), np.full((2, 3), np.inf), ValueError, "grippers must be finite"),
        (
            [[-0.3, 0.15, 0.0], [0.3, 0.15, 0.0]],
            [[-0.3, 0.15, 0.0], [0.0, 0.15, 0.0]],
            SimulationDivergedError,
            "passes through an obstacle",
        ),
    ],
)
def test_ropes_that_cannot_be_are_refused(nodes, grippers, error, words):
    with pytest.raises(error, match=words):
        reduce_rope(nodes, grippers, pillars())


def test_bad_rows_are_refused():
    scene = pillars()
    reduced = start_band(scene)
    for predicted, executed, words in (
        (reduced[:, :-3], reduced, r"predicted must have the shape \(any, \d+\)"),
        (reduced, np.repeat(reduced, 2, axis=0), r"executed must have the shape \(1, \d+\)"),
        (reduced * np.nan, reduced, "predicted must be finite"),
    ):
        with pytest.raises(ValueError, match=words):
            bands_close(predicted, executed, scene)


def test_a_reduced_state_starts_with_the_grippers():
    scene = load_scene("simple_hook")
    reduced = start_band(scene)[0]
    assert reduced.shape == (reduced_dim(scene),)
    np.testing.assert_array_equal(reduced[:6], scene.start.ravel())
    np.testing.assert_array_equal(reduced[6:9], scene.start[0])
    np.testing.assert_array_equal(reduced[-3:], scene.start[1])
