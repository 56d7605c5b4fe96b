"""Starts out of bounds, angles at π, goals judged one by one, and goals drawn from a region."""

import re

import numpy as np
import pytest
from test_planners import GOAL, START, FastHalfPlane, HalfPlane, assert_same_plan, assert_sound
from toy_systems import Disc, Odometer, RightOf, Shore, Turntable

from planners import BiasedRRT, BiasedRRTConnect, ExecutionStatus, PlanResult, evaluate, execute
from reliability import StoreError, collect_transitions
from systems import Car, CarScene, GoalRegion, PlanarArm, Problem

PLANNERS = [BiasedRRTConnect, BiasedRRT]


@pytest.mark.parametrize("estimator", [None, HalfPlane(), FastHalfPlane()], ids=str)
@pytest.mark.parametrize("planner", PLANNERS)
def test_a_system_that_left_its_bounds_is_planned_for(planner, estimator):
    for seed in range(3):
        plan = planner(Disc(), estimator, random_state=seed).plan([-1.2, 1.1], GOAL)
        assert_sound(Disc(), plan, [-1.2, 1.1], GOAL)


@pytest.mark.parametrize("planner", PLANNERS)
def test_the_model_decides_whether_a_start_out_of_bounds_will_do(planner):
    class Walled(Disc):
        def propagate(self, reduced, command):
            following, valid = super().propagate(reduced, command)
            return following, valid & (np.abs(following) <= 1).all(axis=1)

    with pytest.raises(ValueError, match="start_reduced must be a state from which propagate is"):
        planner(Walled()).plan([-1.2, 1.1], GOAL)


def test_a_fallen_arm_is_planned_for(arm):
    """Its first joint may come to rest well beyond π."""
    fallen = arm.rollout([2.9, 0.3, 0.3], np.tile([3.1, 0.3, 0.3], (3, 1))).states[-1]
    assert fallen[0] > np.pi + 0.5
    plan = BiasedRRTConnect(arm, random_state=0).plan(fallen, [1.5, 0.0, 0.0])
    assert plan.success
    np.testing.assert_array_equal(plan.reduced[0], fallen)


def test_executions_go_on_from_out_of_bounds():
    class Gust(Disc):
        """Which is blown out of bounds once, near the start."""

        def rollout(self, state, commands):
            rollout = super().rollout(state, commands)
            if len(commands) and state[0] == -0.9:
                rollout.states[1][:] = [-1.1, 0.0]
            return rollout

    problem = Problem(np.array([-0.9, 0.0]), np.array([[-0.6, 0.5]]))
    planner = BiasedRRTConnect(None, random_state=0)
    execution = execute(Gust(), planner, problem, tolerance=0.01, max_replans=1)
    assert execution.status is ExecutionStatus.REACHED
    np.testing.assert_array_equal(execution.plans[1].reduced[0], [-1.1, 0.0])


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("turns", [-2, 0, 2])
def test_angles_of_starts_and_goals_are_wrapped(planner, turns):
    system, start, goal = Turntable(), np.array([3.0, 0.5]), np.array([[-3.1, -0.5]])
    turned = np.array([turns * np.pi, 0.0])
    plain = planner(system, random_state=0).plan(start, goal)
    wound = planner(system, random_state=0).plan(start + turned, goal + turned)
    np.testing.assert_allclose(wound.reduced, plain.reduced, atol=1e-12)
    assert np.abs(wound.commands).sum() < 3, "the short way round"


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_goal_at_pi_is_one_at_minus_pi(planner):
    car = Car(CarScene((), (0.0, 0.0, 6.0, 4.0)))
    plan = planner(car, random_state=0).plan([2.0, 2.0, np.pi], [[3.0, 2.0, np.pi]])
    assert plan.success
    assert (plan.reduced[:, 2] < np.pi).all()
    assert plan.reduced[0, 2] == -np.pi
    assert np.abs(plan.commands[:, 2]).sum() < 1.5


@pytest.mark.parametrize("planner", PLANNERS)
def test_goals_that_will_not_do_are_left_out(planner):
    hopeless = np.array([[np.nan, 0.0], [0.0, 7.0], [0.0, 0.0], [np.inf, np.inf]])
    alone = planner(Disc(), random_state=0).plan(START, GOAL)
    for goals in (np.vstack([GOAL, hopeless]), np.vstack([hopeless, GOAL])):
        assert_same_plan(planner(Disc(), random_state=0).plan(START, goals), alone)


@pytest.mark.parametrize("planner", PLANNERS)
def test_an_angle_may_start_anywhere_out_of_narrow_bounds(planner):
    class Limited(Turntable):
        bounds = np.array([[-0.5, -1.0], [0.5, 1.0]])

    plan = planner(Limited(), random_state=0).plan([3.0, 0.0], [[0.2, 0.0]])
    assert_sound(Limited(), plan, [3.0, 0.0], [[0.2, 0.0]])


def test_a_nan_is_no_angle():
    with pytest.raises(ValueError, match="goal must be finite"):
        BiasedRRT(Turntable()).plan([0.0, 0.0], [[np.nan, 0.0]])


@pytest.mark.parametrize("simplify", [True, False])
@pytest.mark.parametrize("estimator", [None, HalfPlane(), FastHalfPlane()], ids=str)
@pytest.mark.parametrize("planner", PLANNERS)
def test_plans_end_in_a_region(planner, estimator, simplify):
    ends = set()
    for seed in range(5):
        make = planner(Disc(), estimator, simplify=simplify, random_state=seed)
        plan = make.plan([-0.9, 0.5], RightOf(0.8))
        assert_sound(Disc(), plan, [-0.9, 0.5], plan.reduced[-1])
        assert RightOf(0.8).distance(plan.reduced[-1:])[0] == 0
        if estimator is not None:
            assert plan.reduced[-1, 1] >= 0, "where standing still is trusted"
        ends.add(tuple(plan.reduced[-1]))
        assert_same_plan(make.plan([-0.9, 0.5], RightOf(0.8)), plan)
    assert len(ends) > 1


def test_the_rest_of_the_state_does_not_keep_from_a_region():
    start = np.array([*START, 2.0])
    plan = BiasedRRT(Odometer(), random_state=0).plan(start, RightOf(0.7))
    assert_sound(Odometer(), plan, start, plan.reduced[-1, :2])
    assert plan.reduced[-1, 0] >= 0.7


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_start_in_the_region_is_a_plan_of_nothing(planner):
    plan = planner(Disc(), random_state=0).plan([0.9, 0.3], RightOf(0.8))
    assert plan.success
    np.testing.assert_array_equal(plan.reduced, np.tile([0.9, 0.3], (len(plan.reduced), 1)))


class Mostly(RightOf):
    """Of which only every hundredth draw is where one may stay; keeps its draws."""

    def __init__(self, x, free=None):
        super().__init__(x)
        self.free, self.draws = free, []

    def sample(self, rng, n):
        drawn = super().sample(rng, n)
        if self.free is not None:
            drawn[rng.random(n) > self.free] = 0
        self.draws.append(drawn)
        return drawn


@pytest.mark.parametrize("planner", PLANNERS)
def test_goals_are_drawn_until_one_will_do(planner):
    region = Mostly(0.8, free=0.05)
    assert planner(Disc(), random_state=3).plan(START, region).success
    assert len(region.draws) > 1


class NearTheTop:
    """Trusts only what starts above y = 0.85."""

    classes_ = np.array([0, 1])
    validation_accuracy_ = 0.9

    def predict(self, X):
        return (X[:, 1] > 0.85).astype(int)


@pytest.mark.parametrize("planner", PLANNERS)
def test_distrusted_goals_are_drawn_again(planner):
    for seed in range(4):
        make = planner(Disc(), NearTheTop(), k=0.1, random_state=seed)
        assert make.plan(START, RightOf(0.95)).reduced[-1, 1] > 0.85


@pytest.mark.parametrize("planner", PLANNERS)
def test_more_goals_are_drawn_as_the_search_goes_on(planner):
    """All first draws lie in a pocket without a way in."""

    class Pocket(Disc):
        def propagate(self, reduced, command):
            following, valid = super().propagate(reduced, command)
            return following, valid & ((following[:, 0] > 0.8) == (reduced[:, 0] > 0.8))

    class First(RightOf):
        n_drawn = 0

        def sample(self, rng, n):
            self.n_drawn += n
            if self.n_drawn > 40:
                return rng.uniform([0.5, -0.9], [0.7, 0.9], size=(n, 2))
            return rng.uniform([0.85, -0.1], [1.0, 0.1], size=(n, 2))

    plan = planner(Pocket(), random_state=0, max_iterations=4000).plan(START, First(0.5))
    assert plan.success
    assert 0.5 <= plan.reduced[-1, 0] <= 0.7


class Nothing(RightOf):
    def sample(self, rng, n):
        return np.empty((0, 2))


class OneNumber(RightOf):
    def sample(self, rng, n):
        return np.zeros((n, 1))


@pytest.mark.parametrize(
    ("region", "message"),
    [
        (
            Mostly(0.8, free=0.0),
            r"none of 640 draws from .*Mostly.* goal\[0\] must be .* propagate",
        ),
        (Nothing(0.8), "none of 640 draws .* Its sample returned no configuration"),
        (OneNumber(0.8), r"OneNumber.sample must have the shape \(any, 2\), got \(16, 1\)"),
    ],
)
@pytest.mark.parametrize("planner", PLANNERS)
def test_a_region_of_nothing_is_refused(planner, region, message):
    with pytest.raises(ValueError, match=re.compile(message, re.S)):
        planner(Disc()).plan(START, region)


def test_plans_to_a_region_are_saved(tmp_path):
    plan = BiasedRRT(Disc(), random_state=0).plan(START, RightOf(0.8))
    plan.save(tmp_path / "plan.npz")
    assert_same_plan(PlanResult.load(tmp_path / "plan.npz"), plan)


def test_data_of_problems_with_regions_are_collected_and_told_apart(tmp_path):
    arguments = {"n_plans": 4, "random_state": 0, "path": tmp_path / "data"}
    data = collect_transitions(Shore(), BiasedRRTConnect(None), **arguments)
    again = collect_transitions(
        Shore(), BiasedRRTConnect(None), n_jobs=2, n_plans=4, random_state=0
    )
    np.testing.assert_array_equal(again.reduced, data.reduced)
    with pytest.raises(StoreError, match=r"x\b"):
        collect_transitions(Shore(0.9), BiasedRRTConnect(None), **arguments)


def test_executions_succeed_where_they_come_near_enough_to_the_region():
    evaluation = evaluate(Shore(), BiasedRRTConnect(None), 5, tolerance=1e-9, random_state=0)
    assert evaluation.n_succeeded == 5
    assert all(status is ExecutionStatus.REACHED for status in evaluation.status)
    # The point moves half as far as commanded where x > 0.6: it comes to 0.7 at least.
    for tolerance, n in ((0.0, 0), (0.11, 5)):
        stuck = evaluate(
            Shore(0.8, sticky=True), BiasedRRTConnect(None), 5, tolerance=tolerance, random_state=0
        )
        assert stuck.n_succeeded == n


def test_the_arms_plans_end_where_its_tip_is_on_a_point():
    """A region that draws by inverse kinematics, some of whose draws have no solution."""

    class TipAt(GoalRegion):
        def __init__(self, point):
            self.point, self.arm = point, PlanarArm()

        def sample(self, rng, n):
            return self.arm.inverse_kinematics(self.point, rng.uniform(-np.pi, np.pi, n))[:n]

        def distance(self, configurations):
            tips = self.arm.joint_positions(configurations)[:, -1]
            return np.linalg.norm(tips - self.point, axis=1)

    region = TipAt(np.array([0.4, 0.9]))
    for planner in PLANNERS:
        plan = planner(PlanarArm(), random_state=0).plan([-1.5, 0.0, 0.0], region)
        assert region.distance(plan.reduced[-1:])[0] < 1e-9
