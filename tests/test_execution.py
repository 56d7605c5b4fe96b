"""Carrying out plans: where the system leaves one, and what is done then."""

import joblib
import numpy as np
import pytest
from executed_toys import Fragile, Peg, Point, Slow, StickyPeg, Straight, Wind
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.linear_model import LogisticRegression
from toy_systems import Disc, Odometer, Turntable

from planners import BiasedRRT, BiasedRRTConnect, ExecutionStatus, execute
from planners.distrust import DistrustedTransitions
from systems import Problem, StopReason

ACROSS = Problem(np.array([-0.55, 0.0]), np.array([[0.55, 0.0]]))


def cross(system, planner=None, **parameters):
    planner = Straight(system) if planner is None else planner
    return execute(system, planner, ACROSS, **{"tolerance": 0.05} | parameters)


def test_a_plan_that_goes_well_is_carried_out_to_its_end():
    for max_replans in (0, 3):
        execution = cross(Point(), max_replans=max_replans)
        assert execution.status is ExecutionStatus.REACHED
        assert execution.success
        assert execution.n_replans == 0
        np.testing.assert_allclose(execution.states, execution.plans[0].reduced)
        np.testing.assert_array_equal(execution.commands, execution.plans[0].commands)
        assert execution.stop_reason is StopReason.COMPLETED
        assert execution.plan_starts == [0]
        assert execution.planning_time > 0


def test_without_replans_it_is_planning_and_one_rollout():
    disc, problem = Disc(), Disc().sample_problem(3)
    planner = BiasedRRTConnect(disc, random_state=5)
    plan = planner.plan(problem.start, problem.goal)
    execution = execute(disc, planner, problem, tolerance=0.1)
    np.testing.assert_array_equal(execution.commands, plan.commands)
    np.testing.assert_array_equal(
        execution.states, disc.rollout(problem.start, plan.commands).states
    )
    assert execution.plans[0].random_state == 5


def test_closed_loop_arrives_where_open_loop_does_not():
    open_loop = cross(Slow())
    assert open_loop.status is ExecutionStatus.LEFT_PLAN
    np.testing.assert_allclose(open_loop.states[-1], [0.0, 0.0], atol=1e-12)
    closed_loop = cross(Slow(), BiasedRRTConnect(Slow(), random_state=0), max_replans=60)
    assert closed_loop.success
    assert 5 < closed_loop.n_replans < 60


def test_new_plans_begin_where_the_system_is():
    system = Slow()
    planner = BiasedRRTConnect(system, random_state=0)
    execution = cross(system, planner, max_replans=3)
    assert execution.n_replans == 3
    assert execution.plan_starts == [0, 1, 2, 3], "the first step of each plan already fails"
    for plan, start in zip(execution.plans, execution.plan_starts, strict=True):
        np.testing.assert_array_equal(plan.reduced[0], execution.states[start])
    rest = execution.plans[-1].commands
    np.testing.assert_array_equal(execution.commands[-len(rest) :], rest)
    assert planner.system is system
    assert planner.random_state == 0


@pytest.mark.parametrize("kind", [Peg, StickyPeg])
@pytest.mark.parametrize("estimator", [None, "regression"])
def test_it_goes_around_what_blocked_it(kind, estimator, monkeypatch):
    system = kind()
    if estimator is not None:
        X = np.random.default_rng(0).normal(size=(50, 4))
        estimator = LogisticRegression().fit(X, np.arange(50) % 50 > 0)
    planner = BiasedRRTConnect(system, estimator, accuracy=0.9, random_state=0)
    assert not cross(system, planner).success
    execution = cross(system, planner, max_replans=15)
    assert execution.success
    assert execution.n_replans >= 1
    assert min(np.linalg.norm(state) for state in execution.states) >= system.radius
    monkeypatch.setattr("planners.distrust.ALIKE", -1.0)
    assert not cross(system, planner, max_replans=15).success, "what failed fails again"


def test_a_system_that_carries_more_than_its_configuration_goes_around_too():
    class OdometerWithPeg(Odometer):
        radius = 0.0

        def rollout(self, state, commands):
            return Peg().rollout(state, commands)

    system = OdometerWithPeg()
    problem = Problem(np.array([-0.3, 0.0]), np.array([[0.3, 0.0]]))
    planner = BiasedRRT(system, random_state=0)
    assert not execute(system, planner, problem, tolerance=0.02).success
    assert execute(system, planner, problem, tolerance=0.02, max_replans=20).success


def test_a_first_problem_without_a_plan():
    execution = cross(Point(), Straight(n_plans=0), max_replans=2)
    assert execution.status is ExecutionStatus.NO_PLAN
    assert not execution.success
    assert execution.commands.shape == (0, 2)
    assert execution.stop_reason is None
    assert len(execution.states) == len(execution.plans) == 1


def test_without_a_new_plan_the_rest_of_the_old_one_is_carried_out():
    system = Peg()
    execution = cross(system, Straight(system), max_replans=2)
    assert execution.status is ExecutionStatus.NO_PLAN
    assert execution.n_replans == 1
    assert len(execution.commands) == len(execution.plans[0].commands)
    np.testing.assert_array_equal(execution.states, cross(system, Straight(system)).states)

    assert cross(system, Straight(system), max_replans=2, tolerance=2.0).success


@pytest.mark.parametrize("max_replans", [0, 2])
def test_stopped_at_a_constraint(max_replans):
    execution = cross(StickyPeg(), BiasedRRTConnect(None, random_state=0), max_replans=max_replans)
    assert execution.status is ExecutionStatus.CONSTRAINT
    assert execution.stop_reason is StopReason.CONSTRAINT
    assert execution.n_replans == max_replans
    assert len(execution.states) == len(execution.commands) + 1


def test_stopped_at_a_constraint_and_without_a_new_plan_nothing_more_is_done():
    execution = cross(StickyPeg(), Straight(), max_replans=2)
    assert execution.status is ExecutionStatus.NO_PLAN
    assert execution.stop_reason is StopReason.CONSTRAINT
    assert len(execution.commands) == len(cross(StickyPeg(), Straight()).commands)
    assert len(execution.commands) < len(execution.plans[0].commands)


def test_where_no_plan_may_start():
    class WalledWind(Wind):
        def propagate(self, reduced, command):
            following, valid = super().propagate(reduced, command)
            return following, valid & (np.abs(following) <= 1).all(axis=1)

    execution = cross(WalledWind(), max_replans=2, tolerance=0.03)
    assert execution.status is ExecutionStatus.START_NOT_ALLOWED
    assert execution.n_replans == 0

    class Trap(Slow):
        def propagate(self, reduced, command):
            following, valid = super().propagate(reduced, command)
            return following, valid & (np.abs(reduced[:, 0] + 0.5) > 1e-6)

    start = Problem(np.array([-0.55, 0.0]), np.array([[-0.45, 0.0]]))
    execution = execute(Trap(), Straight(), start, tolerance=0.01, max_replans=1)
    assert execution.status is ExecutionStatus.START_NOT_ALLOWED


def test_a_plan_that_ends_close_to_the_goal_and_not_near_enough():
    class Drifts(Point):
        def move(self, state, command):
            return state + command + [0.001, 0], True

    missed = cross(Drifts(), tolerance=0.005)
    assert missed.status is ExecutionStatus.MISSED
    assert cross(Drifts(), tolerance=0.005, max_replans=1).success, "planned again from there"

    class Coarse(Drifts):
        def goal_reached(self, reduced, goal):
            return np.linalg.norm(reduced - goal, axis=1) < 0.03

    execution = cross(Coarse(), tolerance=0.005, max_replans=4)
    assert execution.status is ExecutionStatus.MISSED
    assert execution.n_replans == 1, "there is nothing to carry out in any other plan either"


@pytest.mark.parametrize("max_replans", [0, 2])
def test_the_simulator_diverges(max_replans):
    execution = cross(Fragile(), max_replans=max_replans)
    assert execution.status is ExecutionStatus.SIMULATION_DIVERGED
    assert len(execution.states) == len(execution.commands) + 1


def test_arriving_by_chance_is_arriving():
    class Leap(Point):
        def move(self, state, command):
            return ACROSS.goal[0], True

    execution = cross(Leap(), max_replans=3)
    assert execution.success
    assert len(execution.commands) == 1
    assert execution.n_replans == 0


def test_every_status_is_a_sentence():
    assert all(status.value.endswith(".") for status in ExecutionStatus)


def test_the_same_seed_gives_the_same_execution():
    def run(seed):
        planner = BiasedRRTConnect(Peg(), random_state=seed)
        return cross(Peg(), planner, max_replans=4)

    first, again, other = run(0), run(np.int64(0)), run(1)
    assert joblib.hash(first.states) == joblib.hash(again.states)
    assert [plan.random_state for plan in first.plans] == [p.random_state for p in again.plans]
    assert first.n_replans > 0
    assert len({plan.random_state for plan in first.plans}) == len(first.plans)
    assert joblib.hash(first.states) != joblib.hash(other.states)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"tolerance": -1}, "tolerance must be a number between 0"),
        ({"tolerance": np.nan}, "tolerance must be"),
        ({"max_replans": -1}, "max_replans must be an integer of at least 0, got -1"),
        ({"max_replans": 1.5}, "max_replans must be"),
        ({"max_replans": True}, "max_replans must be"),
        ({"planner": BiasedRRTConnect(Disc())}, "planner has the system"),
    ],
)
def test_bad_arguments_are_refused(parameters, message):
    with pytest.raises(ValueError, match=message):
        cross(Point(), **parameters)


def test_a_problem_that_the_planner_refuses_is_an_error():
    outside = Problem(np.array([30.0, 0.0]), ACROSS.goal)
    with pytest.raises(ValueError, match="start_reduced must lie near the bounds"):
        execute(Point(), BiasedRRTConnect(None), outside, tolerance=0.1, max_replans=2)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.integers(0, 4), st.floats(0, 0.08))
def test_executions_hang_together(seed, max_replans, strength):
    class Gusts(Point):
        def move(self, state, command):
            return state + command + strength * np.sin(40 * state[::-1]), True

    system = Gusts()
    problem = system.sample_problem(seed)
    execution = execute(
        system, BiasedRRTConnect(None, random_state=seed), problem, tolerance=0.05,
        max_replans=max_replans,
    )  # fmt: skip
    states, commands = execution.states, execution.commands
    assert len(states) == len(commands) + 1
    for before, command, after in zip(states[:-1], commands, states[1:], strict=True):
        np.testing.assert_array_equal(system.rollout(before, command[None]).states[1], after)
    assert execution.n_replans <= max_replans
    assert len(execution.plan_starts) == len(execution.plans)
    assert execution.plan_starts == sorted(execution.plan_starts)
    assert execution.success == system.succeeded(states[-1], problem.goal, 0.05)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.integers(0, 10**6))
def test_distrusted_is_what_begins_close_and_moves_alike(seed):
    rng, system = np.random.default_rng(seed), Point()
    distrusted = DistrustedTransitions(system)
    failed = [rng.uniform(-0.1, 0.1, (2, 2)) for _ in range(3)]
    for reduced, next_reduced in failed:
        distrusted.add(reduced, next_reduced)
    assert len(distrusted) == 3
    asked = rng.uniform(-0.1, 0.1, (40, 2, 2))
    expected = [
        any(
            np.linalg.norm(b - origin) < system.close_distance
            and np.linalg.norm((c - b) - (end - origin)) <= 0.5 * np.linalg.norm(end - origin)
            for origin, end in failed
        )
        for b, c in asked
    ]
    assert distrusted.includes(asked[:, 0], asked[:, 1]).tolist() == expected
    command = asked[:, 1] - asked[:, 0]
    view = distrusted.left_out_of(system)
    np.testing.assert_array_equal(~view.propagate(asked[:, 0], command)[1], expected)
    assert system.propagate(asked[:, 0], command)[1].all(), "the system itself is as it was"
    assert not distrusted.includes(asked[:0, 0], asked[:0, 1]).size


def test_distrust_knows_that_angles_wrap():
    system = Turntable()
    distrusted = DistrustedTransitions(system)
    distrusted.add(np.array([3.10, 0.0]), np.array([-3.10, 0.0]))
    forwards = np.array([[3.09, 0.0]]), np.array([[-3.11, 0.0]])
    assert distrusted.includes(*forwards).all()
    assert not distrusted.includes(forwards[0], 2 * forwards[0] - 3.2).any()


@pytest.mark.parametrize("allowed", [True, False])
def test_what_g_predicts_from_the_executed_state_is_distrusted(allowed, monkeypatch):
    """Or what was planned, where g predicts nothing from there."""

    class Drifts(Point):
        close_distance = 0.05

        def move(self, state, command):
            return state + command + [0.0, 0.03], True

        def propagate(self, reduced, command):
            following, _ = super().propagate(reduced, command)
            return following, (np.abs(reduced[:, 1]) < 0.02) | allowed

    found = []
    monkeypatch.setattr(DistrustedTransitions, "add", lambda _, *ends: found.append(ends))
    execution = cross(Drifts(), max_replans=1)
    assert len(found) == 1
    states, planned = execution.states, execution.plans[0].reduced
    expected = (states[1], states[1] + execution.commands[1]) if allowed else planned[1:3]
    np.testing.assert_allclose(found[0], expected)


def test_standing_still_stays_trusted():
    distrusted = DistrustedTransitions(Point())
    distrusted.add(np.zeros(2), np.zeros(2))
    assert len(distrusted) == 0
    system = Point()
    assert distrusted.left_out_of(system) is system, "nothing to leave out"
