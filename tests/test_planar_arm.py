"""The arm: physics, geometry and the paper's effect."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from systems import PlanarArm, SimulationDivergedError, StopReason, check_system

HANGING, STANDING = np.array([-np.pi / 2, 0, 0]), np.array([np.pi / 2, 0, 0])
configurations = arrays(np.float64, (4, 3), elements=st.floats(-3.1, 3.1))


def steps_through(*waypoints):
    """Configurations one step apart along straight lines."""
    path = [np.asarray(waypoints[0])]
    for waypoint in np.asarray(waypoints[1:]):
        n = int(np.ceil(np.linalg.norm(waypoint - path[-1]) / PlanarArm.step_size))
        path += list(np.linspace(path[-1], waypoint, n + 1)[1:])
    return np.array(path)


def test_the_arm_keeps_the_contract(arm):
    check_system(arm)


def test_the_straight_way_up_fails(arm):
    path = steps_through(HANGING, STANDING)
    rollout = arm.rollout(path[0], path[1:])
    assert not arm.succeeded(rollout.states[-1], STANDING[None], 1.0)
    assert rollout.states[-1][0] < 0, "the arm should have stuck below horizontal"


def test_a_folded_way_up_succeeds(arm):
    folded = [-np.pi / 2, 2.8, -2.8]
    path = steps_through(HANGING, folded, [np.pi / 2, 2.8, -2.8], STANDING)
    rollout = arm.rollout(path[0], path[1:])
    assert arm.succeeded(rollout.states[-1], STANDING[None], 0.075)
    assert arm.close(path, rollout.states).all()
    assert rollout.stop_reason is StopReason.COMPLETED
    assert rollout.n_completed == len(path) - 1


def test_joint_one_cannot_hold_the_extended_arm_and_can_hold_it_folded(arm):
    assert arm.can_hold([[0, 0, 0], [0, 3, -3], HANGING, STANDING]).tolist() == [
        False,
        True,
        True,
        True,
    ]


def test_rollouts_repeat_and_continue_exactly(arm, rng):
    path = steps_through(*rng.uniform(-3, 3, (3, 3)))
    whole = arm.rollout(path[0], path[1:]).states
    np.testing.assert_array_equal(whole, PlanarArm().rollout(path[0], path[1:]).states)
    second_half = arm.rollout(whole[10], path[11:]).states
    np.testing.assert_array_equal(whole[10:], second_half)


def test_a_pickled_arm_starts_its_simulator_anew(arm):
    arm.can_hold([HANGING])
    again = pickle.loads(pickle.dumps(arm))
    path = steps_through(HANGING, [-1.0, 0.5, 0.2])
    np.testing.assert_array_equal(
        again.rollout(path[0], path[1:]).states, arm.rollout(path[0], path[1:]).states
    )


def test_threads_have_simulations_of_their_own(arm, rng):
    ends = rng.uniform(-3, 3, (12, 2, 3))
    expected = [arm.rollout(start, [end]).states for start, end in ends]
    with ThreadPoolExecutor(4) as pool:
        states = pool.map(lambda pair: arm.rollout(pair[0], pair[1:]).states, ends)
        np.testing.assert_array_equal(list(states), expected)


def test_settling_ends_at_rest(arm):
    """What is commanded again from where the arm came to rest moves it no more."""
    at_rest = arm.rollout(STANDING, [[1.2, 0.3, -0.4]]).states[-1]
    again = arm.rollout(at_rest, [[1.2, 0.3, -0.4]]).states[-1]
    np.testing.assert_allclose(again, at_rest, atol=5e-3)
    falling = arm.rollout([0.0, 0, 0], [[0.0, 0, 0]]).states[-1]
    assert falling[0] < -1


def test_divergence_is_an_error_of_its_own(arm, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo by itself writes a log where it runs.
    with pytest.raises(SimulationDivergedError, match="diverged when"):
        arm.rollout([1e11, 0, 0], [[0.0, 0, 0]])
    assert not list(tmp_path.iterdir())


@given(configurations, configurations)
@settings(deadline=None, max_examples=50, derandomize=True)
def test_g_arrives_where_steer_commands_within_one_step(current, target):
    arm = PlanarArm()
    command = arm.steer(current, target)
    following, valid = arm.propagate(current, command)
    assert valid.all()
    np.testing.assert_array_equal(following, command)
    assert (np.linalg.norm(following - current, axis=1) <= arm.step_size * (1 + 1e-9)).all()


@given(st.floats(0, 1.49), st.floats(-np.pi, np.pi))
@settings(deadline=None, max_examples=50, derandomize=True)
def test_inverse_kinematics_puts_the_tip_on_the_target(distance, bearing):
    arm = PlanarArm()
    target = distance * np.array([np.cos(bearing), np.sin(bearing)])
    solutions = arm.inverse_kinematics(target, np.linspace(-3, 3, 9))
    tips = arm.joint_positions(solutions)[:, 3]
    np.testing.assert_allclose(tips, np.tile(target, (len(tips), 1)), atol=1e-6)
    assert (np.abs(solutions) <= np.pi).all()


def test_inverse_kinematics_finds_both_elbows_of_each_heading_within_reach(arm):
    target, headings = np.array([0.9, 0.3]), np.array([0.0, 2.0, -0.5, np.pi])
    solutions = arm.inverse_kinematics(target, headings)
    wrists = target - 0.5 * np.column_stack([np.cos(headings), np.sin(headings)])
    possible = headings[np.linalg.norm(wrists, axis=1) <= 1]
    assert 0 < len(possible) < 4
    found = np.sum(solutions, axis=1)
    np.testing.assert_allclose(np.cos(found), np.cos(np.tile(possible, 2)), atol=1e-9)
    np.testing.assert_allclose(np.sin(found), np.sin(np.tile(possible, 2)), atol=1e-9)
    np.testing.assert_allclose(solutions[: len(possible), 1], -solutions[len(possible) :, 1])
    assert len(arm.inverse_kinematics(target, [])) == 0


def test_joints_are_where_the_links_end(arm):
    positions = arm.joint_positions(np.array([[np.pi / 2, -np.pi / 2, np.pi / 2]]))
    np.testing.assert_allclose(positions[0], [[0, 0], [0, 0.5], [0.5, 0.5], [0.5, 1.0]], atol=1e-12)


def test_close_and_goals_have_their_thresholds(arm):
    near = np.array([[0.0749, 0, 0], [0.0751, 0, 0], [0.05, 0.05, 0.03], [0, 1e-7, 0]])
    assert arm.close(near, np.zeros((4, 3))).tolist() == [True, False, False, True]
    goal = np.array([[1.0, 1, 1], [0, 0, 0]])
    assert arm.goal_reached(near, goal).tolist() == [False, False, False, True]


def test_problems_start_at_rest_and_repeat(arm):
    for seed in range(5):
        problem, again = arm.sample_problem(seed), arm.sample_problem(np.random.default_rng(seed))
        assert arm.can_hold(problem.start[None])[0]
        np.testing.assert_array_equal(problem.start, again.start)
        np.testing.assert_array_equal(problem.goal, again.goal)
    goals = np.vstack([arm.sample_problem(seed).goal for seed in range(20)])
    assert not arm.can_hold(goals).all(), "goals are any configurations"


def test_queries_start_where_asked_and_can_be_ended(arm):
    for seed in range(5):
        problem = arm.sample_reaching_problem(seed)
        assert arm.can_hold(problem.start[None])[0]
        assert arm.can_hold(problem.goal).any()
        tips = arm.joint_positions(problem.goal)[:, 3]
        np.testing.assert_allclose(tips, np.tile(tips[0], (len(tips), 1)), atol=1e-9)
    starts = [arm.sample_reaching_problem(s, start_at_rest=False).start for s in range(20)]
    assert not arm.can_hold(starts).all()


def test_success_needs_any_one_solution_within_the_tolerance(arm):
    goal = np.array([[0.0, 0, 0], [1, 1, 1]])
    assert arm.succeeded([1.05, 1, 1], goal, 0.075)
    assert not arm.succeeded([1.05, 1, 1], goal, 0.05)
    assert not arm.succeeded([2 * np.pi, 0, 0], goal, 1.0), "a turn too many"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda arm: arm.rollout([0, 0], [[0, 0, 0]]), r"state must have the shape \(3\)"),
        (lambda arm: arm.rollout([0, np.nan, 0], [[0, 0, 0]]), "state must be finite"),
        (lambda arm: arm.rollout([0, 0, 0], [[0, np.inf, 0]]), "commands must be finite"),
        (lambda arm: arm.rollout([0, 0, 0], [0, 0, 0]), "commands must have the shape"),
        (lambda arm: arm.reduce([0, 0]), "state must have the shape"),
        (lambda arm: arm.steer(np.zeros(3), np.zeros(3)), r"reduced .* of shape \(n, 3\)"),
        (lambda arm: arm.features(np.zeros((2, 4)), np.zeros((2, 4))), r"shape \(n, 3\)"),
        (lambda arm: arm.inverse_kinematics([1.6, 0], [0.0]), "within the arm's reach"),
        (lambda arm: arm.sample_problem(-1), "random_state must not be negative"),
        (lambda arm: arm.sample_problem("seed"), "random_state must be None, an integer"),
    ],
)
def test_bad_input_is_refused(arm, call, message):
    with pytest.raises(ValueError, match=message):
        call(arm)
