"""Carrying out plans: where the system leaves one, and what is done then."""

import itertools

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
from planners.remaining_plan import still_arrives
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
    execution = cross(system, planner, max_replans=3, tolerance=0.04)
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


class Places(Point):
    """Its commands are places to go to; a gust at its second step is made up for by the third."""

    gust = np.array([0.0, 0.07])

    def propagate(self, reduced, command):
        return command.copy(), np.ones(len(command), dtype=bool)

    def steer(self, reduced, configuration):
        return reduced + super().steer(reduced, configuration)

    def move(self, state, command):
        return command + (self.gust if abs(command[0] + 0.35) < 0.01 else 0), True


def test_leaving_a_plan_is_not_failing():
    """Commands that name places lead back to the plan, as g says."""
    open_loop, closed_loop = cross(Places()), cross(Places(), max_replans=3)
    assert open_loop.success
    assert closed_loop.success
    assert closed_loop.n_replans == 0
    np.testing.assert_array_equal(closed_loop.states, open_loop.states)
    parted = np.linalg.norm(closed_loop.states - closed_loop.plans[0].reduced, axis=1)
    assert parted.max() > Places.close_distance


def test_a_plan_is_given_up_where_its_rest_is_not_valid():
    class Walled(Places):
        def propagate(self, reduced, command):
            following, valid = super().propagate(reduced, command)
            beside = (np.abs(reduced[:, 1]) > 0.05) & (np.abs(command[:, 1]) < 0.05)
            return following, valid & ~beside

    class Around(Straight):
        def plan(self, start_reduced, goal):
            if abs(start_reduced[1]) > 0.05:
                goal = np.array([[0.55, start_reduced[1]]])
            return super().plan(start_reduced, goal)

    execution = cross(Walled(), Around(), max_replans=3, tolerance=0.1)
    assert execution.success
    assert execution.plan_starts == [0, 2]


class Gust(Point):
    """A gust at the first step, for which nothing makes up."""

    def move(self, state, command):
        return state + command + (Places.gust if state[0] < -0.5 else 0), True


class Once(Straight):
    """Its second plan has no commands, and is none or takes the start for the goal."""

    def __init__(self, success):
        super().__init__()
        self.success = success

    def plan(self, start_reduced, goal):
        found = super().plan(start_reduced, goal)
        if len(self.seeds) == 2:
            found.success, found.commands = self.success, found.commands[:0]
            found.reduced = found.reduced[:1]
        return found


@pytest.mark.parametrize(("tolerance", "n_replans"), [(0.08, 0), (0.06, 1)])
def test_a_plan_is_given_up_where_its_rest_would_miss_the_goal(tolerance, n_replans):
    """Displacements carry a gust on to the end, where the tolerance may cover it or not."""

    execution = cross(Gust(), max_replans=3, tolerance=tolerance)
    assert execution.success
    assert execution.plan_starts == [0, 1][: 1 + n_replans]
    assert cross(Gust(), tolerance=tolerance).success == (n_replans == 0)


@pytest.mark.parametrize("success", [True, False])
def test_after_a_search_in_vain_planning_is_tried_again_where_the_old_plan_ends(success):
    execution = cross(Gust(), Once(success), max_replans=2)
    assert execution.success
    assert execution.plan_starts == [0, 1, len(execution.plans[0].commands)]
    failed = cross(Gust(), Once(success), max_replans=1)
    assert failed.status is (ExecutionStatus.MISSED if success else ExecutionStatus.NO_PLAN)
    assert len(failed.commands) == len(failed.plans[0].commands)


def test_a_plan_is_given_up_where_a_new_one_may_start():
    class Fenced(Gust):
        def propagate(self, reduced, command):
            following, valid = super().propagate(reduced, command)
            return following, valid & ((np.abs(reduced[:, 1]) < 0.05) | (reduced[:, 0] > -0.2))

    execution = cross(Fenced(), max_replans=1)
    assert execution.success
    assert execution.plan_starts == [0, 4], "at the first state beyond x = -0.2"


def test_the_rest_of_a_plan_does_not_use_what_has_just_failed():
    """Not even where the goal is so large that g predicts an arrival."""
    execution = cross(Peg(), BiasedRRTConnect(None, random_state=0), max_replans=15, tolerance=0.12)
    assert execution.success
    stood = [np.array_equal(*pair) for pair in itertools.pairwise(execution.states)]
    assert execution.plan_starts[1] == 1 + stood.index(True)


def test_a_stop_is_planned_for_again_at_once():
    execution = cross(StickyPeg(), BiasedRRTConnect(None, random_state=0), max_replans=15)
    assert execution.success
    start = execution.plan_starts[1]
    blocked = execution.states[start - 1] + execution.commands[start - 1]
    assert np.linalg.norm(blocked) < StickyPeg.radius
    assert start < len(execution.plans[0].commands)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.integers(0, 10**6))
def test_what_g_says_of_the_rest_of_a_plan(seed):
    rng = np.random.default_rng(seed)
    start, commands = rng.uniform(-0.1, 0.1, 2), rng.uniform(-0.1, 0.1, (rng.integers(1, 5), 2))
    end, tolerance = rng.uniform(-0.2, 0.2, 2), rng.uniform(0, 0.3)
    arrives = np.linalg.norm(start + commands.sum(axis=0) - end) <= tolerance
    assert still_arrives(Point(), start, commands, end, tolerance) == arrives
    at_place = np.linalg.norm(commands[-1] - end) <= tolerance
    assert still_arrives(Places(), start, commands, end, tolerance) == at_place

    class Blocked(Point):
        def propagate(self, reduced, command):
            following, valid = super().propagate(reduced, command)
            return following, valid & (command != commands[-1]).any(axis=1)

    assert still_arrives(Point(), start, commands, end, np.inf)
    assert not still_arrives(Blocked(), start, commands, end, np.inf)


def test_the_end_of_a_plan_is_found_across_the_seam_of_an_angle():
    command = np.zeros((1, 2))
    ends = np.array([3.13, 0.0]), np.array([-3.13, 0.0])
    assert still_arrives(Turntable(), ends[0], command, ends[1], 0.05)
    assert not still_arrives(Turntable(), ends[0], command, ends[1], 0.01)


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
    assert execution.n_replans == 2, "where the plan was given up, and at its end"
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
    states, planned = execution.states, execution.plans[0].reduced
    expected = (states[1], states[1] + execution.commands[1]) if allowed else planned[1:3]
    np.testing.assert_allclose(found[0], expected)


def test_standing_still_stays_trusted():
    distrusted = DistrustedTransitions(Point())
    distrusted.add(np.zeros(2), np.zeros(2))
    assert len(distrusted) == 0
    system = Point()
    assert distrusted.left_out_of(system) is system, "nothing to leave out"
