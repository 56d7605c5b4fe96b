"""Every search ends within its budget, however wrong the system or the goal is."""

import numpy as np
import pytest
from test_planners import FastHalfPlane, HalfPlane
from toy_systems import Disc

from planners import BiasedRRT, BiasedRRTConnect, PlanStatus
from systems import Box, Car, CarScene, Circle, GoalRegion, Rope, Scene

PLANNERS = [BiasedRRTConnect, BiasedRRT]
START, GOAL = [-0.9, -0.9], [[0.9, 0.9]]


class TurnsInFarRounds(Disc):
    """Whose ``steer`` leads round the origin for targets that are far away."""

    def steer(self, reduced, configuration):
        command = super().steer(reduced, configuration)
        far = np.linalg.norm(configuration - reduced, axis=1) > 0.3
        command[far] = 0.1 * reduced[far][:, ::-1] * [-1, 1]
        return command


class CreepsFromAfar(Disc):
    def steer(self, reduced, configuration):
        command = super().steer(reduced, configuration)
        command[np.linalg.norm(configuration - reduced, axis=1) > 0.3] *= 1e-9
        return command


class NeverArrives(Disc):
    def goal_reached(self, reduced, goal):
        return np.zeros(len(reduced), dtype=bool)


class TinySteps(Disc):
    step_size = 1e-9


@pytest.mark.parametrize("system", [TurnsInFarRounds, CreepsFromAfar, NeverArrives, TinySteps])
def test_an_rrt_ends_that_never_arrives(system):
    plan = BiasedRRT(system(), max_iterations=100, random_state=0).plan(START, GOAL)
    assert plan.status is PlanStatus.ITERATION_LIMIT
    assert len(plan.tree) < 20_000


@pytest.mark.parametrize("estimator", [None, FastHalfPlane(), HalfPlane()], ids=str)
def test_an_rrt_connect_ends_whose_trees_never_meet(estimator):
    planner = BiasedRRTConnect(TinySteps(), estimator, k=9, max_iterations=20, random_state=0)
    plan = planner.plan([-0.9, 0.0], [[0.9, 0.0]])
    assert plan.status is PlanStatus.ITERATION_LIMIT
    assert len(plan.tree) < 50_000


def test_long_edges_across_a_large_space_cost_nothing_more():
    class Large(Disc):
        bounds = np.array([[-40.0, -40.0], [40.0, 40.0]])

    for planner in PLANNERS:
        plan = planner(Large(), max_iterations=200, random_state=0).plan(START, [[-39.0, 39.0]])
        assert plan.success


def test_restarts_end_with_the_time_even_if_no_search_takes_long():
    planner = BiasedRRT(NeverArrives(), restarts=10**12, max_iterations=8, time_limit=0.2)
    assert not planner.plan(START, GOAL).success


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize(
    ("attribute", "value", "message"),
    [
        ("step_size", 0.0, "Bad.step_size must be a positive number, got 0.0"),
        ("step_size", np.nan, "Bad.step_size must be a positive number, got nan"),
        ("step_size", "1", "Bad.step_size must be a positive number, got '1'"),
        ("step_size", 1e-300, "Bad.step_size must be large enough to lead anywhere"),
        ("bounds", np.array([[-1e17] * 2, [1e17] * 2]), "Bad.step_size must be large enough"),
        ("bounds", [[-1, -1], [1, 1]], "Bad.bounds must be a numpy array, got"),
        ("bounds", np.array([[-1, -1], [1, np.inf]]), "Bad.bounds must be finite"),
        ("bounds", np.array([[1, 1], [-1, -1]]), "Bad.bounds must be lower limits, then upper"),
        ("bounds", np.ones((2, 3)), r"Bad.bounds must have the shape \(2, 2\), got \(2, 3\)"),
    ],
)
def test_a_space_that_no_search_could_end_in_is_refused(planner, attribute, value, message):
    bad = type("Bad", (Disc,), {attribute: value})
    with pytest.raises(ValueError, match=message):
        planner(bad()).plan(START, GOAL)


class Region(GoalRegion):
    def __init__(self, sample, distance=lambda places: np.linalg.norm(places - 0.9, axis=1)):
        self.sample = lambda rng, n: sample(n)
        self.distance = distance

    def sample(self, rng, n):
        raise NotImplementedError

    def distance(self, configurations):
        raise NotImplementedError


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize(
    ("sample", "message"),
    [
        (lambda n: [], "Its sample returned no configuration"),
        (lambda n: np.empty((0, 2)), "Its sample returned no configuration"),
        (lambda n: np.full((n, 2), np.nan), "must be finite"),
        (lambda n: np.full((n, 2), 7.0), "must lie within the bounds"),
        (lambda n: np.zeros((n, 2)), "must be a configuration at which propagate is valid"),
        (lambda n: None, "Region.sample must have the shape"),
        (lambda n: np.zeros(n), "Region.sample must have the shape"),
    ],
)
def test_a_region_that_never_yields_is_refused(planner, sample, message):
    with pytest.raises(ValueError, match=message):
        planner(Disc(), random_state=0).plan(START, Region(sample))


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize(
    "sample", [lambda n: [[0.9, 0.9]] * n, lambda n: np.full((10 + 100 * n, 2), 0.9)]
)
def test_regions_may_yield_lists_and_too_many(planner, sample):
    plan = planner(Disc(), random_state=0).plan(START, Region(sample))
    assert plan.success
    np.testing.assert_allclose(plan.reduced[-1], [0.9, 0.9])


@pytest.mark.parametrize(
    "distance", [lambda c: None, lambda c: 1.0, lambda c: np.ones((len(c), 1)), lambda c: ["far"]]
)
def test_distances_of_another_shape_are_refused(distance):
    region = Region(lambda n: np.full((n, 2), 0.9), distance)
    with pytest.raises(ValueError, match=r"Region.distance must"):
        BiasedRRT(Disc()).plan(START, region)


@pytest.mark.parametrize(
    "scene", [CarScene((Circle(4, 4, 20),)), CarScene((), (0.0, 0.0, 0.01, 0.01))]
)
def test_a_lot_without_room_for_a_car_has_no_problems(scene):
    with pytest.raises(ValueError, match="scene must have room for a car"):
        Car(scene).sample_problem(0)


def test_a_world_without_room_for_grippers_has_no_configurations():
    ends = np.array([[-0.47, 0.47, 0.47], [-0.3, 0.47, 0.47]])
    bounds = np.array([[-0.5] * 3, [0.5] * 3])
    scene = Scene([Box((0, 0, 0), (0.4469,) * 3)], bounds, 0.3, ends, ends * [1, -1, 1])
    with pytest.raises(ValueError, match="scene 'scene' must have room for two grippers"):
        Rope(scene).sample_configurations(np.random.default_rng(0), 1000)
