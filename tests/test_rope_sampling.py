"""Where the rope's starts and configurations are drawn, and how rows are checked at the door."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rope_states import polyline_length, slow_margin

import systems
from systems import Box, Rope, RopeState, RopeStopReason, Scene, StopReason
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.paper_scenes import load_scene
from systems.rope.sampling import draw_grippers, draw_hanging_rope
from systems.rope.scene import GRIPPER_CLEARANCE, ROPE_RADIUS, STEP_SIZE

NAMES = ("simple_hook", "complex_hook", "multi_hook", "engine_assembly")


@pytest.mark.parametrize("name", NAMES)
def test_grippers_are_drawn_in_clear_space_and_within_reach(name, rng):
    scene = load_scene(name)
    pairs = draw_grippers(scene, rng, 200, 0.4).reshape(-1, 2, 3)
    assert len(pairs) == 200
    assert np.linalg.norm(pairs[:, 0] - pairs[:, 1], axis=1).max() <= 0.4
    assert min(slow_margin(scene, pair) for pair in pairs) >= GRIPPER_CLEARANCE
    low, high = scene.bounds
    thirds = np.floor(3 * (pairs[:, 0] - low) / (high - low)).astype(int)
    assert all(set(thirds[:, axis]) == {0, 1, 2} for axis in range(3)), "everywhere in the world"


def test_gripper_b_is_uniform_in_the_ball_around_a_where_nothing_is_in_the_way(rng):
    world = [[-9.0] * 3, [9.0] * 3]
    start = [[0.0, 0.2, 0.0], [0.0, -0.2, 0.0]]
    scene = Scene([], world, 1.0, start, start)
    pairs = draw_grippers(scene, rng, 4000, 1.0).reshape(-1, 2, 3)
    way = pairs[:, 1] - pairs[:, 0]
    np.testing.assert_allclose(way.mean(axis=0), 0.0, atol=0.03)
    # The volume within r grows with r cubed.
    shares = np.sort(np.linalg.norm(way, axis=1)) ** 3
    np.testing.assert_allclose(shares, np.linspace(0.0, 1.0, 4000), atol=0.04)


@pytest.mark.parametrize("name", NAMES)
def test_ropes_are_drawn_that_hang_free_far_from_the_goal_and_on_their_own_side(name, rng):
    scene = load_scene(name)
    drawn = [draw_hanging_rope(scene, rng) for _ in range(600)]
    ropes = [nodes for nodes in drawn if nodes is not None]
    assert 5 < len(ropes) < 400
    for nodes in ropes:
        ends = nodes[[0, -1]]
        assert nodes.shape == (scene.n_nodes, 3)
        assert polyline_length(nodes) == pytest.approx(scene.rope_length, rel=0.01)
        assert signed_distance(nodes, scene.packed).min() > 0.9 * ROPE_RADIUS
        way = np.linalg.norm(scene.goal - ends)
        assert way >= 0.75 * np.linalg.norm(scene.goal - scene.start)
        for own, other in ((0, 1), (1, 0)):
            to_own = np.linalg.norm(ends[own] - scene.start[own])
            assert to_own <= np.linalg.norm(ends[own] - scene.start[other])


def test_drawing_follows_from_the_generator():
    rope = Rope("multi_hook")
    one, other = (rope.sample_configurations(np.random.default_rng(4), 7) for _ in range(2))
    np.testing.assert_array_equal(one, other)
    rng = np.random.default_rng(4)
    first, second = rope.sample_configurations(rng, 7), rope.sample_configurations(rng, 7)
    np.testing.assert_array_equal(first, one)
    assert not np.array_equal(second, one)


def test_a_world_without_room_for_a_hanging_rope_says_so():
    # A corridor so low and narrow that only a rope that is straight along it fits.
    world = [[-0.04, -0.28, 0.2], [0.04, 0.28, 0.3]]
    floor = Box((0.0, 0.0, 0.1), (0.2, 0.3, 0.1), "floor")
    start = np.array([[0.0, -0.25, 0.25], [0.0, 0.25, 0.25]])
    scene = Scene([floor], world, 0.5, start, start * [1.0, 0.9, 1.0], name="low")
    with pytest.raises(ValueError, match=r"scene 'low' has no room for a hanging rope.*shorter"):
        Rope(scene).sample_problem(0)


@settings(deadline=None, derandomize=True, max_examples=50)
@given(st.integers(1, 4), st.integers(0, 10**6), st.sampled_from([np.nan, np.inf, -np.inf]))
def test_rows_are_refused_if_one_entry_is_not_finite(n, place, bad):
    rope = Rope("simple_hook_short")
    rows = np.random.default_rng(place).normal(size=(n, rope.reduced_dim))
    np.testing.assert_array_equal(rope.bands(rows), rows)
    np.testing.assert_array_equal(rope.bands(rows.astype(np.float32)), np.float32(rows))
    np.testing.assert_array_equal(rope.bands(rows.tolist()), rows)
    rows.flat[place % rows.size] = bad
    for check in (rope.bands, lambda b: rope.close(b, b), lambda b: rope.steer(b, b[:, :6])):
        with pytest.raises(ValueError, match="must be finite, got NaN or infinity"):
            check(rows)


def test_what_is_no_array_of_rows_is_refused_by_name():
    rope = Rope("simple_hook_short")
    rows = np.zeros((2, rope.reduced_dim))
    for given_rows, words in (
        (rows[0], r"reduced must have the shape \(any, \d+\), got \(\d+,?\)"),
        (rows[:, :2], r"reduced must have the shape \(any, \d+\), got \(2, 2\)"),
        ("rows", "reduced must be an array of numbers"),
        (None, "reduced must"),
        ([[1, 2, 3], [4, 5]], "reduced must be an array of numbers"),
    ):
        with pytest.raises(ValueError, match=words):
            rope.steer(given_rows, rows[:, :6])
    with pytest.raises(ValueError, match="command must have as many rows as reduced, 2, got 1"):
        rope.propagate(rows, rows[:1, :6])
    with pytest.raises(ValueError, match="configuration must have the shape"):
        rope.steer(rows, rows[:, :4])


seeds = st.integers(0, 2**32 - 1)


@settings(deadline=None, derandomize=True, max_examples=30)
@given(seeds)
def test_steps_lead_straight_to_their_target_and_arrive(seed):
    rng = np.random.default_rng(seed)
    rope = Rope("simple_hook")
    row = rope.reduce(RopeState(rope.scene.start, rope.scene.start_rope()))[None]
    row[0, :6] += rng.normal(scale=0.1, size=6)
    target = row[:, :6] + rng.normal(size=(1, 6)) * rng.choice([1e-3, 0.01, 0.3])
    distance = np.linalg.norm(target - row[:, :6])
    command = rope.steer(row, target)
    assert np.linalg.norm(command) == pytest.approx(min(STEP_SIZE, distance))
    n_steps = int(np.ceil(distance / STEP_SIZE - 1e-9))
    for _ in range(n_steps):
        row[:, :6] += rope.steer(row, target)
    np.testing.assert_allclose(row[:, :6], target, atol=1e-12)


def test_close_is_reflexive_and_symmetric():
    rope = Rope("engine_assembly")
    start = rope.reduce(RopeState(rope.scene.start, rope.scene.start_rope()))
    rng = np.random.default_rng(3)
    rows = np.tile(start, (60, 1))
    for target in rope.sample_configurations(rng, 4):
        for _ in range(12):
            rows, _ = rope.propagate(rows, rope.steer(rows, np.tile(target, (60, 1))))
            rows[rng.integers(60, size=20)] = rows[rng.integers(60, size=20)]
            rows[:10] = start
    assert rope.close(rows, rows).all()
    others = rows[rng.permutation(60)]
    close = rope.close(rows, others)
    np.testing.assert_array_equal(rope.close(others, rows), close)
    assert 0 < close.sum() < 60


def test_users_get_the_ropes_state_and_reasons_from_systems():
    assert {"RopeState", "RopeStopReason"} <= set(systems.__all__)
    assert {reason.name for reason in StopReason} >= {"COMPLETED", "CONSTRAINT"}
    reasons = {reason.name for reason in RopeStopReason}
    assert reasons == {"GRIPPER_CONTACT", "EDGE_OF_WORLD", "OVERSTRETCHED"}
    for reason in RopeStopReason:
        assert pickle.loads(pickle.dumps(reason)) is reason
        assert reason.value.endswith(".")
    rope = Rope("engine_assembly")
    scene = rope.scene
    by_hand = RopeState(scene.start, scene.start_rope())
    rollout = rope.rollout(by_hand, np.zeros((1, 6)))
    assert rollout.stop_reason is StopReason.COMPLETED
    assert rope.reduce(by_hand).shape == (rope.reduced_dim,)
