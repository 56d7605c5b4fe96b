"""Planning for the car: headings that wrap, and plans that the example makes safer."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.car.compared_planners import TrueCar, plan_query
from benchmarks.car.waypoints import move_waypoints
from planners import BiasedRRT, BiasedRRTConnect
from systems import Car, CarScene, Circle, Problem, random_car_scene

BEHIND = CarScene((Circle(3.0, 2.0, 0.4),), (0.0, 0.0, 6.0, 4.0))
BOTH = pytest.mark.parametrize("planner_class", [BiasedRRT, BiasedRRTConnect])


class TrustsRoom:
    """Trusts transitions the more, the more room is at their end."""

    classes_ = np.array([0, 1])
    validation_accuracy_ = 0.9

    def decision_function(self, X):
        return 8 * X[:, 5] - 0.5

    def predict(self, X):
        return (self.decision_function(X) > 0).astype(int)

    def predict_proba(self, X):
        reliable = 1 / (1 + np.exp(-self.decision_function(X)))
        return np.column_stack([1 - reliable, reliable])


@BOTH
def test_plans_turn_the_short_way_round(planner_class):
    """From one side of ±π to the other, with nothing to go round."""
    car = Car(CarScene((), (0.0, 0.0, 6.0, 4.0)))
    start, goal = np.array([2.0, 2.0, 3.0]), np.array([[3.0, 2.0, -3.0]])
    plan = planner_class(car, random_state=0).plan(start, goal)
    assert plan.success
    assert np.abs(plan.commands[:, 2]).sum() < 2.0
    assert car.goal_reached(plan.reduced[-1:], goal)[0]


@BOTH
@pytest.mark.parametrize("estimator", [None, TrustsRoom()])
def test_plans_are_what_the_model_allows(planner_class, estimator):
    car = Car(BEHIND)
    start, goal = np.array([1.0, 2.0, 3.0]), np.array([[5.0, 2.0, -3.0]])
    plan = planner_class(car, estimator, k=np.inf, random_state=1).plan(start, goal)
    assert plan.success
    assert (np.linalg.norm(plan.commands, axis=1) <= car.step_size + 1e-9).all()
    following, valid = car.propagate(plan.reduced[:-1], plan.commands)
    assert valid.all()
    assert (car.distance(following, plan.reduced[1:]) < 1e-9).all()
    again = planner_class(car, estimator, k=np.inf, random_state=1).plan(start, goal)
    np.testing.assert_array_equal(plan.reduced, again.reduced)
    if estimator is not None:
        assert plan.reliability.min() > 0.5


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_moved_waypoints_are_never_less_reliable(seed):
    car, classifier = Car(random_car_scene(seed)), TrustsRoom()
    problem = car.sample_problem(seed)
    planner = BiasedRRTConnect(car, classifier, k=np.inf, max_iterations=500, random_state=seed)
    plan = planner.plan(problem.start[:3], problem.goal)
    moved = move_waypoints(car, classifier, plan, seed)
    assert moved.success_probability >= plan.success_probability * (1 - 1e-6)
    if plan.success:
        np.testing.assert_array_equal(moved.reduced[[0, -1]], plan.reduced[[0, -1]])
        following, valid = car.propagate(moved.reduced[:-1], moved.commands)
        assert valid.all()
        assert (car.distance(following, moved.reduced[1:]) < 1e-9).all()
        rows = car.features(moved.reduced[:-1], moved.reduced[1:])
        assert (classifier.predict(rows) == 1).all()
        np.testing.assert_allclose(
            classifier.predict_proba(rows)[:, 1], moved.reliability, atol=1e-9
        )
    np.testing.assert_array_equal(
        moved.reduced, move_waypoints(car, classifier, plan, seed).reduced
    )


def test_the_ceilings_plans_are_executed_as_planned():
    scene = Car("open_lot").scene
    problem = Problem(np.array([1.0, 1.0, 0.0, 1.5, 0.0]), np.array([[3.0, 1.2, 0.2]]))
    plan = plan_query("ceiling", scene, None, problem, 0)
    assert plan.success
    states = TrueCar(scene).rollout(problem.start, plan.commands).states
    np.testing.assert_allclose(states, plan.reduced, atol=1e-9)
