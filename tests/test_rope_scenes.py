import pickle

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from planners import BiasedRRT
from systems import Car, Rollout, Rope, StopReason, random_rope_scene
from systems.rope.catenary import hanging_rope
from systems.rope.obstacles.shapes import Box
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.paper_scenes import SCENE_NAMES, load_scene
from systems.rope.random_scenes import has_slot_and_slit
from systems.rope.scene import GRIPPER_CLEARANCE, GRIPPER_RADIUS, ROPE_RADIUS, Scene

PAPER_LENGTHS = {
    "simple_hook_short": 0.55,
    "simple_hook": 0.87,
    "simple_hook_long": 1.13,
    "simple_hook_very_long": 1.59,
    "multi_hook": 0.87,
    "complex_hook": 0.87,
    "engine_assembly": 0.87,
}
BOUNDS = [[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]
START = [[-0.5, 0.3, 0.0], [-0.5, -0.3, 0.0]]
GOAL = [[0.5, 0.2, 0.0], [0.5, -0.2, 0.0]]
PILLAR = Box((0.0, 0.0, 0.0), (0.1, 0.1, 1.0), "pillar")


def scene(**changes):
    arguments = {
        "obstacles": [PILLAR],
        "bounds": BOUNDS,
        "rope_length": 0.6,
        "start": START,
        "goal": GOAL,
    }
    return Scene(**(arguments | changes))


def length_of(nodes):
    return np.linalg.norm(np.diff(nodes, axis=0), axis=1).sum()


def test_there_are_the_papers_seven_scenes():
    assert set(SCENE_NAMES) == set(PAPER_LENGTHS)


def test_an_unknown_name_is_answered_with_the_known_ones():
    with pytest.raises(ValueError, match=r"simple_hook_short.*engine_assembly.*'hook'"):
        load_scene("hook")


@pytest.mark.parametrize("name", SCENE_NAMES)
def test_the_papers_lengths_are_those_at_which_the_rope_is_overstretched(name):
    scene = load_scene(name)
    assert scene.max_stretch == 1.15
    assert scene.max_band_length == pytest.approx(PAPER_LENGTHS[name], abs=0.005)
    assert length_of(scene.start_rope()) == pytest.approx(scene.rope_length)


@pytest.mark.parametrize("name", SCENE_NAMES)
def test_ropes_start_clear_and_goals_can_be_held(name):
    scene = load_scene(name)
    nodes = scene.start_rope()
    assert nodes.shape == (scene.n_nodes, 3)
    np.testing.assert_array_equal(nodes[[0, -1]], scene.start)
    assert signed_distance(nodes, scene.packed).min() > ROPE_RADIUS
    assert signed_distance(scene.start, scene.packed).min() > GRIPPER_RADIUS
    assert signed_distance(scene.goal, scene.packed).min() > GRIPPER_CLEARANCE


def test_the_simple_hook_is_where_the_authors_put_it():
    scene = load_scene("simple_hook")
    assert scene.n_nodes == 39
    names = {obstacle.name: obstacle for obstacle in scene.obstacles}
    hook, wall = names["hook"], names["upper wall"]
    assert hook.center == pytest.approx((-0.1625, 0.0, -0.05))
    assert hook.half_extents == pytest.approx((0.5375, 0.025, 0.025))
    assert wall.center == pytest.approx((0.4, 0.0, 0.225))
    # The slit is 0.1 m high, so that grippers that keep 0.03 m away have 0.04 m left.
    assert signed_distance(np.array([0.4, 0.2, 0.0]), scene.packed) == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("name", "slit"),
    [("complex_hook", (-0.6, 0.1, 0.0)), ("multi_hook", (-0.35, 0.0, 0.25))],
)
def test_slits_are_a_tenth_of_a_metre_high(name, slit):
    assert signed_distance(np.array(slit), load_scene(name).packed) == pytest.approx(0.05)


def test_scenes_pickle():
    before = load_scene("engine_assembly")
    after = pickle.loads(pickle.dumps(before))
    np.testing.assert_array_equal(before.packed, after.packed)
    np.testing.assert_array_equal(before.goal, after.goal)


@given(
    st.tuples(*[st.floats(-0.5, 0.5)] * 3),
    st.floats(0.1, 1.5),
    st.integers(20, 80),
)
@settings(deadline=None, derandomize=True)
def test_a_slack_rope_hangs_evenly_between_the_grippers(span, length, n_nodes):
    grippers = np.array([[0.1, 0.2, 0.3], np.add([0.1, 0.2, 0.3], span)])
    nodes = hanging_rope(grippers, length, n_nodes)
    links = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    np.testing.assert_allclose(nodes[[0, -1]], grippers, atol=1e-9)
    longest = max(length, np.linalg.norm(span)) / (n_nodes - 1)
    assert links.max() <= longest * 1.001
    # Where it turns back on itself, one link may be cut short by the bend.
    assert np.sort(links)[3] >= longest * 0.9
    # It hangs in the vertical plane of the grippers, never above their chord.
    chord = np.linspace(grippers[0], grippers[1], 1000)
    for node in nodes[1:-1]:
        across = np.linalg.norm(chord[:, :2] - node[:2], axis=1)
        assert across.min() < 1e-3
        assert node[2] <= chord[across <= across.min() + 1e-3, 2].max() + 1e-3


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"start": [[-0.5, 0.3, np.nan], [-0.5, -0.3, 0.0]]}, "start must be finite"),
        ({"goal": [[0.5, 0.2, 0.0]]}, r"goal must have the shape \(2, 3\), got \(1, 3\)"),
        ({"bounds": [[-1.0, -1.0, np.inf], [1.0, 1.0, 1.0]]}, "bounds must be finite"),
        ({"bounds": BOUNDS[::-1]}, "lower corner and then the upper"),
        ({"rope_length": np.nan}, "rope_length must be positive"),
        ({"rope_length": -0.6}, "rope_length must be positive"),
        ({"max_stretch": 0.9}, "max_stretch must be at least 1 and at most 10"),
        ({"rope_length": 0.59}, "shorter than the distance between the grippers.*longer rope"),
        ({"rope_length": 0.5}, "stretched by 1.2, allowed 1.15.*move the grippers together"),
        ({"start": [[0.05, 0.3, 0.0], [0.0, 0.05, 0.0]]}, "start puts gripper B in collision"),
        ({"start": [[0.0, 0.3, 0.0], [0.0, -0.3, 0.0]]}, "The rope starts in collision with 'p"),
        ({"start": [[-2.0, 0.3, 0.0], [-2.0, -0.3, 0.0]]}, "start must lie within the bounds"),
        ({"goal": [[0.5, 0.2, 0.0], [0.99, 0.2, 0.0]]}, "goal must lie within the bounds"),
        ({"goal": [[0.12, 0.0, 0.0], [0.5, 0.0, 0.0]]}, "goal puts gripper A in collision with"),
        ({"goal": [[0.5, 0.4, 0.0], [0.5, -0.4, 0.0]]}, "goal puts the grippers 0.8 m apart"),
        ({"goal": [[0.5, 0.0, 0.0], [0.5, 0.0, 0.0]]}, "goal puts the grippers 0 m apart"),
        ({"obstacles": ["pillar"]}, r"obstacles\[0\] must be a Box, Cylinder, Capsule, Sphere"),
    ],
)
def test_bad_scenes_are_refused_in_words_that_say_what_to_change(changes, words):
    with pytest.raises(ValueError, match=words):
        scene(**changes)


def test_a_slack_rope_that_would_hang_into_an_obstacle_is_refused():
    floor = Box((0.0, 0.0, -0.3), (1.0, 1.0, 0.1), "floor")
    with pytest.raises(ValueError, match="The rope starts in collision with 'floor'"):
        scene(obstacles=[floor], rope_length=1.0)


def test_a_scene_of_ones_own_needs_no_obstacles():
    assert scene(obstacles=[]).packed.shape == (0, 8)


def test_random_scenes_follow_from_their_seed_and_can_be_planned_in():
    scene, again = random_rope_scene(5), random_rope_scene(5)
    np.testing.assert_array_equal(scene.packed, again.packed)
    scenes = [random_rope_scene(seed) for seed in range(40)]
    assert len({len(scene.obstacles) for scene in scenes}) > 4
    lengths = [scene.rope_length for scene in scenes]
    assert min(lengths) < 0.7
    assert max(lengths) > 1.2
    rope = Rope(scenes[1])
    problem = rope.sample_problem(0)
    planner = BiasedRRT(rope, max_iterations=5000, random_state=0)
    assert planner.plan(rope.reduce(problem.start), problem.goal).success


def test_a_slot_lets_only_the_rope_through_and_a_slit_the_grippers_too():
    scenes = [random_rope_scene(seed) for seed in range(13_000, 13_040)]
    both = [scene for scene in scenes if has_slot_and_slit(scene)]
    assert 3 < len(both) < 25
    for scene in both:
        named = {obstacle.name: obstacle for obstacle in scene.obstacles}
        walls = [named[name] for name in ("lower slotted wall", "lower wall", "upper wall")]
        slotted, lower, upper = (np.array([wall.center, wall.half_extents]) for wall in walls)
        # The slot is level with the grippers' start and goal, 5 cm high.
        assert slotted[0, 2] + slotted[1, 2] == pytest.approx(-0.025)
        assert ROPE_RADIUS < 0.025 < GRIPPER_CLEARANCE
        # The slit is around the same height, and grippers fit through it.
        bottom, top = lower[0, 2] + lower[1, 2], upper[0, 2] - upper[1, 2]
        assert bottom + top == pytest.approx(0.0, abs=1e-12)
        assert 0.09 <= top - bottom <= 0.2
        assert top - bottom > 2 * GRIPPER_CLEARANCE
        # The slotted wall parts the grippers, whose sides of the room it leaves open.
        a, b = scene.start[0, 1], scene.start[1, 1]
        assert b < slotted[0, 1] < a


def test_random_scenes_take_any_kind_of_random_state():
    expected = random_rope_scene(7).packed
    for random_state in (np.int64(7), np.random.default_rng(7), np.random.SeedSequence(7)):
        np.testing.assert_array_equal(random_rope_scene(random_state).packed, expected)
    rng = np.random.default_rng(7)
    random_rope_scene(rng)
    assert not np.array_equal(random_rope_scene(rng).packed, expected), "a generator advances"


@given(st.tuples(*[st.floats(-0.5, 0.5)] * 3), st.floats(0.1, 1.5))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_a_catenary_is_a_catenary_and_the_same_from_either_end(span, length):
    grippers = np.array([[0.1, 0.2, 0.3], np.add([0.1, 0.2, 0.3], span)])
    nodes = hanging_rope(grippers, length, 401)
    np.testing.assert_allclose(hanging_rope(grippers[::-1], length, 401)[::-1], nodes, atol=1e-6)
    shift = np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(
        hanging_rope(grippers + shift, length, 401), nodes + shift, atol=1e-9
    )
    width, apart = np.hypot(span[0], span[1]), np.linalg.norm(span)
    if width < 0.05 or length < 1.05 * apart:
        return
    # Along a catenary the slope grows in proportion to the arc length.
    steps = np.diff(nodes, axis=0)
    slopes = steps[:, 2] / np.hypot(steps[:, 0], steps[:, 1])
    growth = np.diff(slopes)[5:-5]
    np.testing.assert_allclose(growth, growth.mean(), rtol=1e-2)
    assert growth.mean() > 0.0, "it sags"


def test_scenes_ropes_and_rollouts_are_shown_in_a_line():
    rope = Rope("simple_hook", features="clearance")
    shown = repr(rope.scene)
    assert shown == "Scene('simple_hook', 7 obstacles, rope_length=0.76, max_stretch=1.15)"
    assert repr(rope) == "Rope('simple_hook', engine='mujoco', features='clearance')"
    rollout = Rollout([0, 1, 2], 1, StopReason.CONSTRAINT)
    assert repr(rollout) == "Rollout(3 states, 1 commands completed, CONSTRAINT)"
    assert repr(Car()).startswith(f"Car({len(Car().scene.obstacles)} obstacles, bounds=(")
