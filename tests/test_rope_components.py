"""Counts of the parts below the grippers, and the parabola that bounds them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.integrate import quad

from systems import Box, Cylinder, Rope, Scene
from systems.rope.band.band import band_length, reduced_dim
from systems.rope.features.parabola_kernels import parabola_bend, parabola_length
from systems.rope.features.vector import vector_features
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.paper_scenes import load_scene

CELL = 0.0125
WORLD = np.array([[-1.0] * 3, [1.0] * 3])
ENDS = np.array([[0.0, -0.25, 0.0], [0.0, 0.25, 0.0]])
SEPARATIONS, LENGTHS, COUNTS = slice(0, 2), slice(2, 4), slice(4, 13)
ALL, FREE, OCCUPIED = range(3)
BEFORE, AFTER, CHANGE = range(3)

widths = st.floats(0.03, 1.0)
rises = st.floats(-0.8, 0.8)


@settings(deadline=None, derandomize=True)
@given(st.floats(0.0, 40.0), widths, rises)
def test_the_parabolas_length_is_the_integral_along_it(bend, width, rise):
    def speed(s):
        return np.hypot(1.0, rise / width - bend * (width - 2 * s))

    expected = quad(speed, 0.0, width, limit=200)[0]
    assert parabola_length(bend, width, rise) == pytest.approx(expected, rel=1e-6)


@settings(deadline=None, derandomize=True)
@given(widths, rises, st.floats(0.01, 2.0))
def test_the_bend_gives_the_length_that_was_asked_for(width, rise, slack):
    chord = np.hypot(width, rise)
    bend = parabola_bend(width, rise, chord + slack)
    assert parabola_length(bend, width, rise) == pytest.approx(chord + slack, rel=1e-9)
    assert parabola_bend(width, rise, 0.9 * chord) == pytest.approx(0.0, abs=1e-12)


def straight(scene, ends):
    """A band straight from gripper to gripper, as a row."""
    row = np.empty(reduced_dim(scene))
    row[:6], row[6:9] = np.ravel(ends), ends[0]
    row[9:] = np.tile(ends[1], (len(row) - 9) // 3)
    return row


def scene_with(*obstacles):
    away = ENDS + np.array([0.8, 0.0, 0.3])
    return Scene(obstacles, WORLD, 0.7, away, away)


def counts(scene, before, after=None):
    before = straight(scene, before)
    after = before if after is None else straight(scene, after)
    return vector_features(before[None], after[None], scene)[0, COUNTS].reshape(3, 3)


def plain_counts(scene, ends):
    """Label the cells' regions, each cell looked at by itself."""
    span = ends[1, :2] - ends[0, :2]
    width, rise = np.linalg.norm(span), ends[1, 2] - ends[0, 2]
    bend = parabola_bend(width, rise, scene.max_band_length)
    s = np.arange(CELL / 2, width, CELL)
    chord, curve = rise / width * s, rise / width * s - bend * s * (width - s)
    fine = np.linspace(0.0, width, 100_001)
    low = min(0.0, rise, (rise / width * fine - bend * fine * (width - fine)).min())
    z = np.arange(low + CELL / 2, max(0.0, rise), CELL)
    between = (curve[:, None] <= z) & (z <= chord[:, None])
    on_plane = ends[0, :2] + s[:, None] / width * span
    places = np.empty((*between.shape, 3))
    places[..., :2], places[..., 2] = on_plane[:, None], ends[0, 2] + z
    free = between & (signed_distance(places, scene.packed) > 0.0)
    framed = np.pad(free, 1)
    n_free, n_occupied = ndimage.label(framed)[1], ndimage.label(~framed)[1]
    return [n_free + n_occupied, n_free, n_occupied]


@pytest.mark.parametrize("name", ["simple_hook", "multi_hook", "engine_assembly"])
def test_counts_are_those_of_a_plain_labelling(name, rng):
    rope = Rope(name, features="vector")
    grippers = rope.sample_configurations(rng, 60).reshape(-1, 2, 3)
    rows = np.array([straight(rope.scene, ends) for ends in grippers])
    found = rope.features(rows, np.roll(rows, 1, axis=0))[:, COUNTS].reshape(-1, 3, 3)
    expected = np.array([plain_counts(rope.scene, ends) for ends in grippers])
    # The lowest point of the curve is computed, not sampled, so a row of cells may shift.
    agree = (found[:, :, BEFORE] == expected).all(axis=1)
    assert agree.mean() > 0.95
    np.testing.assert_array_equal(found[:, :, AFTER], np.roll(found[:, :, BEFORE], 1, axis=0))
    np.testing.assert_array_equal(
        found[:, :, CHANGE], found[:, :, AFTER] - found[:, :, BEFORE], "after less before"
    )
    assert len(np.unique(expected, axis=0)) > 2


def test_a_hook_below_the_grippers_is_a_part_of_its_own():
    free = counts(scene_with(), ENDS)
    np.testing.assert_array_equal(free[:, BEFORE], [2, 1, 1])
    hook = Box((0.0, 0.0, -0.12), (0.3, 0.02, 0.02), "hook")
    hooked = counts(scene_with(hook), ENDS)
    np.testing.assert_array_equal(hooked[:, BEFORE], [3, 1, 2])
    np.testing.assert_array_equal(hooked[:, CHANGE], 0)
    beside = counts(scene_with(hook), ENDS, ENDS - np.array([0.5, 0.0, 0.0]))
    np.testing.assert_array_equal(beside[:, CHANGE], [-1, 0, -1])


def test_a_wall_between_the_grippers_parts_the_region():
    wall = Box((0.0, 0.0, -0.5), (0.3, 0.02, 0.495), "wall")
    np.testing.assert_array_equal(counts(scene_with(wall), ENDS)[:, BEFORE], [3, 2, 1])


def test_counts_do_not_depend_on_which_gripper_is_which_nor_on_where_the_scene_is():
    post = Cylinder((0.0, 0.05, -0.15), 0.03, 0.2, axis=0)
    lifted = ENDS + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.07]])
    here = counts(scene_with(post), lifted)
    shift = np.array([0.1, 0.15, -0.05])
    shifted_post = Cylinder(tuple(post.center + shift), 0.03, 0.2, axis=0)
    np.testing.assert_array_equal(here, counts(scene_with(shifted_post), lifted + shift))
    turned = Cylinder((-0.05, 0.0, -0.15), 0.03, 0.2, axis=1)
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_array_equal(here, counts(scene_with(turned), lifted @ quarter.T))


def test_separations_and_lengths_are_shares_of_the_longest_that_is_allowed():
    scene = load_scene("simple_hook")
    before, after = straight(scene, scene.start), straight(scene, 0.9 * scene.start)
    before[9:12] += (0.1, 0.0, 0.2)
    row = vector_features(before[None], after[None], scene)[0]
    apart = np.linalg.norm(scene.start[1] - scene.start[0])
    limit = scene.max_band_length
    np.testing.assert_allclose(row[SEPARATIONS], [apart / limit, 0.9 * apart / limit])
    np.testing.assert_allclose(row[LENGTHS] * limit, band_length(np.array([before, after])))
    assert row[LENGTHS][0] > row[SEPARATIONS][0] + 0.1


def test_grippers_straight_above_one_another_have_a_region_too():
    above = np.array([[0.0, 0.0, 0.3], [0.0, 0.0, 0.0]])
    np.testing.assert_array_equal(counts(scene_with(), above)[FREE, BEFORE], 1)
