"""Ropes that start draped over something, several goals, and goals for one gripper."""

import pickle
from dataclasses import replace

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from rope_states import band_points, polyline_length

from planners import BiasedRRT, ExecutionStatus, execute
from reliability import collect_transitions
from systems import (
    Box,
    Cylinder,
    GoalRegion,
    GripperGoal,
    Rope,
    Scene,
    StopReason,
    check_system,
)
from systems.rope.catenary import hanging_rope, laid_rope
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.scene import GRIPPER_CLEARANCE, ROPE_RADIUS

BOUNDS = [[-1.0] * 3, [1.0] * 3]
BAR = Box((0.0, 0.0, 0.0), (0.3, 0.03, 0.03), "bar")
START = [[0.0, 0.15, -0.2], [0.0, -0.15, -0.2]]
OVER_THE_BAR = [[0.0, 0.05, 0.06], [0.0, -0.05, 0.06]]
BEHIND = [[0.5, 0.15, -0.2], [0.5, -0.15, -0.2]]
ABOVE = [[-0.1, 0.15, 0.3], [-0.1, -0.15, 0.3]]
engines = pytest.mark.parametrize("engine", ["mujoco", "pybullet"])


def draped(**changes):
    arguments = {
        "obstacles": [BAR],
        "bounds": BOUNDS,
        "rope_length": 0.7,
        "start": START,
        "goal": [BEHIND, ABOVE],
        "start_via": OVER_THE_BAR,
    }
    return Scene(**(arguments | changes))


coordinate = st.floats(-0.5, 0.5)


@given(
    st.lists(st.tuples(coordinate, coordinate, coordinate), min_size=3, max_size=7),
    st.floats(1.0, 2.0),
    st.integers(40, 90),
)
@settings(deadline=None, derandomize=True, max_examples=60)
def test_a_laid_rope_passes_its_points_evenly(points, slack, n_nodes):
    points = np.array(points)
    length = max(0.1, slack * polyline_length(points))
    nodes = laid_rope(points, length, n_nodes)
    np.testing.assert_array_equal(nodes[[0, -1]], points[[0, -1]])
    links = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    assert links.max() <= 1.01 * length / (n_nodes - 1)
    # It is cut short only where it turns around.
    assert np.sort(links)[2 * len(points)] >= 0.9 * length / (n_nodes - 1)
    for point in points:
        assert np.linalg.norm(nodes - point, axis=1).min() <= length / (n_nodes - 1)


def test_a_rope_laid_over_nothing_hangs_from_gripper_to_gripper():
    np.testing.assert_array_equal(laid_rope(START, 0.6, 40), hanging_rope(START, 0.6, 40))
    scene = draped(obstacles=[], start_via=())
    np.testing.assert_array_equal(scene.start_rope(), hanging_rope(START, 0.7, scene.n_nodes))
    assert scene.start_via == draped(obstacles=[], start_via=np.zeros((0, 3))).start_via == ()


@engines
def test_a_rope_that_is_draped_over_a_bar_stays_there_and_is_moved(engine):
    scene = draped()
    rope = Rope(scene, engine=engine, features="clearance")
    start = rope.scene_problem().start
    np.testing.assert_allclose(start.grippers, START)
    highest = start.nodes[start.nodes[:, 2].argmax()]
    assert 0.03 < highest[2] < 0.05, "on the bar"
    assert ROPE_RADIUS * 0.9 < signed_distance(start.nodes, scene.packed).min() < 0.013
    row = rope.reduce(start)[None]
    assert band_points(row[0])[:, 2].max() == pytest.approx(0.04, abs=0.006)
    # Its ends are lifted, one after the other, and it is still over the bar.
    commands = np.concatenate(
        [np.tile([0, 0, 0.02, 0, 0, 0], (5, 1)), np.tile([0, 0, 0, 0, 0, 0.02], (5, 1))]
    )
    executed = rope.rollout(start, commands)
    assert executed.stop_reason is StopReason.COMPLETED
    for command, state in zip(commands, executed.states[1:], strict=True):
        row, valid = rope.propagate(row, command[None])
        assert valid[0]
        assert rope.close(row, rope.reduce(state)[None])[0]
    assert band_points(row[0])[:, 2].max() == pytest.approx(0.04, abs=0.006)


def test_a_rope_may_lie_on_the_floor_in_curves():
    floor = Box((0.0, 0.0, -0.05), (1.0, 1.0, 0.05), "floor")
    x = np.linspace(-0.3, 0.3, 30)
    curve = np.column_stack([x, 0.1 * np.sin(2 * np.pi * x / 0.3), np.full(30, 0.014)])
    ends = np.array([[-0.34, 0.0, 0.04], [0.34, 0.0, 0.04]])
    length = 1.001 * polyline_length(np.vstack([ends[:1], curve, ends[1:]]))
    scene = Scene([floor], BOUNDS, length, ends, ends.copy(), start_via=curve)
    start = Rope(scene).scene_problem().start
    inner = start.nodes[4:-4]
    assert np.abs(inner[:, 2] - ROPE_RADIUS).max() < 0.003
    assert np.ptp(inner[:, 1]) > 0.18
    assert np.linalg.norm(start.nodes - scene.start_rope(), axis=1).max() < 0.02


@engines
def test_a_rope_that_slides_off_what_it_is_laid_over_is_refused(engine):
    over = [[0.0, 0.06, 0.09], [0.0, -0.06, 0.09]]
    for slope in (-0.7, -1.0):
        peg = Cylinder((0.0, 0.0, 0.0), 0.03, 0.1, axis=(1.0, 0.0, slope), name="steep peg")
        scene = draped(obstacles=[peg], start_via=over, rope_length=0.8)
        with pytest.raises(ValueError, match="start_via must be points that the rope stays at"):
            Rope(scene, engine=engine).scene_problem()


def test_starts_to_learn_from_are_draped_too():
    rope = Rope(draped(), features="vector")
    starts = [rope.sample_problem(seed).start for seed in range(6)]
    for start in starts:
        for point in OVER_THE_BAR:
            assert np.linalg.norm(start.nodes - point, axis=1).min() < 0.05
    assert np.std([start.grippers for start in starts], axis=0).min() > 0.02
    data = collect_transitions(rope, BiasedRRT(rope, max_iterations=500), 1, random_state=0)
    assert len(data) > 5


@engines
def test_a_plan_ends_at_one_of_several_goals(engine):
    """Of which one, behind a wall, can't be reached."""
    wall = Box((0.4, 0.0, 0.0), (0.02, 1.0, 1.0), "wall")
    for goals in ([BEHIND, ABOVE], [ABOVE, BEHIND]):
        rope = Rope(draped(goal=goals, obstacles=[BAR, wall]), engine=engine, features="vector")
        problem = rope.scene_problem()
        np.testing.assert_array_equal(problem.goal, np.reshape(goals, (2, 6)))
        planner = BiasedRRT(rope, max_iterations=30_000, random_state=1)
        plan = planner.plan(rope.reduce(problem.start), problem.goal)
        assert plan.success
        rollout = rope.rollout(problem.start, plan.commands)
        assert rollout.stop_reason is StopReason.COMPLETED
        assert rope.succeeded(rollout.states[-1], problem.goal, 0.025)
        np.testing.assert_allclose(rollout.states[-1].grippers, ABOVE, atol=0.025)


@engines
@pytest.mark.parametrize("gripper", ["A", "B"])
def test_one_gripper_is_brought_to_its_goal(engine, gripper):
    goal = GripperGoal(gripper, (0.4, 0.1, 0.2))
    rope = Rope(draped(goal=goal), engine=engine, features="vector")
    problem = rope.scene_problem()
    planner = BiasedRRT(rope, max_iterations=30_000, random_state=0)
    execution = execute(rope, planner, problem, tolerance=0.03)
    assert execution.status is ExecutionStatus.REACHED
    grippers = execution.states[-1].grippers
    mine, other = (0, 1) if gripper == "A" else (1, 0)
    np.testing.assert_allclose(grippers[mine], goal.position, atol=0.03)
    assert np.linalg.norm(grippers[other] - goal.position) > GRIPPER_CLEARANCE


def test_goals_for_one_gripper_leave_the_other_where_it_may_be(rng):
    scene = draped(goal=GripperGoal("B", (0.0, 0.08, 0.0)))
    region = Rope(scene).scene_problem().goal
    assert isinstance(region, GoalRegion)
    assert repr(region) == "<GripperGoalRegion: gripper B at [0.0, 0.08, 0.0]>"
    drawn = pickle.loads(pickle.dumps(region)).sample(rng, 500)
    assert 50 < len(drawn) < 500
    np.testing.assert_array_equal(drawn[:, 3:], np.tile((0.0, 0.08, 0.0), (len(drawn), 1)))
    apart = np.linalg.norm(drawn[:, :3] - drawn[:, 3:], axis=1)
    assert apart.min() >= GRIPPER_CLEARANCE
    assert apart.max() <= scene.max_band_length
    assert signed_distance(drawn[:, :3], scene.packed).min() >= GRIPPER_CLEARANCE
    assert (drawn[:, 1] < 0).any(), "behind the bar as well"
    np.testing.assert_array_equal(region.distance(drawn), 0.0)
    np.testing.assert_allclose(region.distance(drawn + 0.1), 0.1 * np.sqrt(3))
    assert not len(region.sample(rng, 0))


class Anywhere(GoalRegion):
    def sample(self, rng, n):
        return rng.uniform(-0.9, 0.9, size=(n, 6))

    def distance(self, configurations):
        return np.zeros(len(configurations))


def test_a_region_of_ones_own_is_a_scenes_goal():
    scene = draped(goal=Anywhere())
    assert Rope(scene).scene_problem().goal is scene.goal
    assert isinstance(Rope(scene).sample_problem(0).goal, Anywhere)


@pytest.mark.slow
def test_ropes_with_draped_starts_and_one_sided_goals_are_systems():
    check_system(Rope(draped(goal=GripperGoal("B", (0.5, 0.1, 0.2))), features="vector"))
    check_system(Rope(draped(), features="vector"))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"start_via": [0.0, 0.0, 0.1]}, r"start_via must have the shape \(any, 3\), got \(3,?\)"),
        ({"start_via": [[0.0, np.nan, 0.1]]}, "start_via must be finite"),
        ({"start_via": "bar"}, "start_via must be an array of numbers"),
        ({"start_via": [[0.0, 0.0, 0.3]]}, r"at least the way from gripper A over start_via.*1\.0"),
        ({"start_via": [[0.0, 0.0, 0.0]]}, "and start_via it passes .* Move the grippers of start"),
        ({"goal": []}, r"goal must have the shape \(2, 3\)"),
        ({"goal": np.zeros((0, 2, 3))}, "goal must hold at least one pair"),
        ({"goal": [BEHIND, [[0.0, 0.0, 0.0], [0.3, 0.3, 0.3]]]}, r"goal\[1\] puts gripper A in c"),
        ({"goal": [[[5.0, 0.0, 0.0], [0.3, 0.3, 0.3]]]}, r"goal\[0\] must lie within the bounds"),
        ({"goal": [BEHIND, [[0.5, 0.5, 0.0], [0.5, -0.5, 0.0]]]}, r"goal\[1\] puts .* 1 m apart"),
        ({"goal": GripperGoal("A", (0.0, 0.0, 0.05))}, "goal puts gripper A in collision with 'b"),
        ({"goal": GripperGoal("A", (0.0, 0.0, 0.99))}, "goal.position must lie within the bounds"),
        ({"goal": [GripperGoal("A", (0.0, 0.0, 0.5))] * 2}, "goal must be an array of numbers"),
    ],
)
def test_bad_starts_and_goals_are_refused_by_name(changes, words):
    with pytest.raises(ValueError, match=words):
        draped(**changes)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("C", (0, 0, 0)), "GripperGoal.gripper must be one of A, B, got 'C'"),
        ((0, (0, 0, 0)), "GripperGoal.gripper must be one of A, B"),
        (("A", (0, 0)), r"GripperGoal.position must have the shape \(3\)"),
        (("A", (0, 0, np.nan)), "GripperGoal.position must be finite"),
    ],
)
def test_no_goal_for_a_gripper_that_is_not_there(arguments, words):
    with pytest.raises(ValueError, match=words):
        GripperGoal(*arguments)


def test_scenes_with_every_kind_of_start_and_goal_pickle():
    for goal in (BEHIND, [BEHIND, ABOVE], GripperGoal("A", (0.4, 0.1, 0.2))):
        scene = draped(goal=goal)
        again = pickle.loads(pickle.dumps(scene))
        np.testing.assert_array_equal(again.start_rope(), scene.start_rope())
        np.testing.assert_equal(again.goal, scene.goal)
        assert replace(again, name="other").name == "other"
