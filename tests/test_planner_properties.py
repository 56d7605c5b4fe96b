"""What holds for every plan, of random small systems with random estimators."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import expit
from test_planners import assert_same_plan
from toy_systems import Disc

from planners import BiasedRRT, BiasedRRTConnect, PlanStatus
from planners.search_tree import SearchTree
from systems.angles import shortest_way, wrap_columns

PLANNERS = [BiasedRRTConnect, BiasedRRT]
several = settings(max_examples=40, deadline=None, derandomize=True)


class Field(Disc):
    """A point among round obstacles in a square; its second coordinate may be an angle.

    Where ``counts``, the reduced state also holds the number of commands so far. ``shift`` moves
    the samples of the second coordinate, but not the square.
    """

    bounds = np.array([[-1.0, -np.pi], [1.0, np.pi]])
    step_size = 0.5

    def __init__(self, obstacles=(), *, turns=False, counts=False, shift=0.0):
        self.obstacles = np.reshape(obstacles, (-1, 3))
        self.angular = (1,) if turns else ()
        self.reduced_dim = 3 if counts else 2
        self.shift = shift
        self.n_samples = 0

    def sample_configurations(self, rng, n):
        self.n_samples += n
        samples = super().sample_configurations(rng, n)
        samples[:, 1] += self.shift
        return wrap_columns(samples, self.angular)

    def propagate(self, reduced, command):
        following = wrap_columns(reduced[:, :2] + command, self.angular)
        valid = self.free(following) & self.free(reduced[:, :2])
        if self.reduced_dim == 3:
            following = np.column_stack([following, reduced[:, 2] + 1])
        return following, valid

    def free(self, points):
        low, high = self.bounds
        inside = ((low <= points) & (points <= high)).all(axis=1)
        way = shortest_way(points[:, None], self.obstacles[None, :, :2], self.angular)
        return inside & (np.linalg.norm(way, axis=2) > self.obstacles[None, :, 2]).all(axis=1)

    def steer(self, reduced, configuration):
        way = shortest_way(reduced[:, :2], configuration, self.angular)
        length = np.linalg.norm(way, axis=1, keepdims=True)
        return way * np.minimum(1, self.step_size / np.maximum(length, 1e-300))

    def features(self, reduced, next_reduced):
        return np.hstack([reduced[:, :2], next_reduced[:, :2]])

    def goal_reached(self, reduced, goal):
        way = shortest_way(reduced[:, None, :2], goal[None], self.angular)
        return (np.linalg.norm(way, axis=2) < 1e-9).any(axis=1)


class Linear:
    """A linear classifier that remembers what it was asked; predicts only, unless subclassed."""

    classes_ = np.array([0, 1])
    validation_accuracy_ = 0.9

    def __init__(self, weights):
        self.weights = np.array(weights)
        self.asked = []

    def logits(self, X):
        return X @ self.weights[1:] + self.weights[0]

    def predict(self, X):
        self.asked.append(X.copy())
        return (self.logits(X) > 0).astype(int)


class LinearWithProbabilities(Linear):
    def predict_proba(self, X):
        reliable = expit(self.logits(X))
        return np.column_stack([1 - reliable, reliable])


class LinearFast(LinearWithProbabilities):
    def fast_decision_function(self, X):
        return self.logits(X)


KINDS = [Linear, LinearWithProbabilities, LinearFast]
coordinates = st.tuples(st.floats(-0.9, 0.9), st.floats(-3.0, 3.0))
obstacles = st.lists(
    st.tuples(st.floats(-1, 1), st.floats(-3, 3), st.floats(0.05, 0.5)), max_size=4
)
weights = st.tuples(st.floats(-1, 2), *[st.floats(-1, 1)] * 4)
seeds = st.integers(0, 2**32 - 1)


@st.composite
def problems(draw):
    """A field, a free start and one or two free goals."""
    points = draw(st.lists(coordinates, min_size=2, max_size=3))
    field = Field(draw(obstacles), turns=draw(st.booleans()), counts=draw(st.booleans()))
    # An obstacle on a start or goal would leave nothing to plan.
    keeps_off = np.linalg.norm(
        shortest_way(field.obstacles[:, None, :2], np.array(points)[None], (1,)), axis=2
    )
    field.obstacles = field.obstacles[(keeps_off > field.obstacles[:, 2:] + 0.01).all(axis=1)]
    start = np.array([*points[0], 7.0])[: field.reduced_dim]
    return field, start, np.array(points[1:])


def planners_of(field):
    return PLANNERS if field.reduced_dim == 2 else [BiasedRRT]


@several
@given(problems(), st.sampled_from([None, *KINDS]), weights, st.sampled_from([0.5, np.inf]), seeds)
def test_every_plan_follows_the_model_from_the_start_to_a_goal(problem, kind, weights, k, seed):
    field, start, goals = problem
    for planner in planners_of(field):
        estimator = None if kind is None else kind(weights)
        parameters = {"k": k, "max_iterations": 400, "random_state": seed}
        result = planner(field, estimator, **parameters).plan(start, goals)
        np.testing.assert_array_equal(result.reduced[0], start)
        assert len(result.reduced) == len(result.commands) + 1
        if not result.success:
            assert result.status is PlanStatus.ITERATION_LIMIT
            assert len(result.commands) == 0
            continue
        assert field.goal_reached(result.reduced[-1:], goals)[0]
        following, valid = field.propagate(result.reduced[:-1], result.commands)
        assert valid.all()
        gaps = shortest_way(following[:, :2], result.reduced[1:, :2], field.angular)
        np.testing.assert_allclose(gaps, 0, atol=1e-9)
        np.testing.assert_array_equal(following[:, 2:], result.reduced[1:, 2:])
        moves = shortest_way(result.reduced[:-1, :2], result.reduced[1:, :2], field.angular)
        assert (np.linalg.norm(moves, axis=1) <= field.step_size * (1 + 1e-8)).all()


@several
@given(problems(), st.sampled_from(KINDS), weights, seeds)
def test_infinite_k_lets_no_unreliable_transition_in(problem, kind, weights, seed):
    field, start, goals = problem
    for planner in planners_of(field):
        estimator = kind(weights)
        strict = planner(field, estimator, k=np.inf, max_iterations=400, random_state=seed)
        result = strict.plan(start, goals)
        rows = field.features(result.reduced[:-1], result.reduced[1:])
        assert (estimator.logits(rows) > 0).all()
        assert result.n_accepted_unreliable == 0


@several
@given(problems(), weights, st.floats(0.1, 3), seeds)
def test_the_counts_are_of_what_was_asked(problem, weights, k, seed):
    field, start, goals = problem
    for planner in planners_of(field):
        estimator = Linear(weights)
        parameters = {"simplify": False, "max_iterations": 200, "random_state": seed}
        result = planner(field, estimator, k=k, **parameters).plan(start, goals[:1])
        # The report asks once more about the plan's own transitions.
        asked = np.concatenate([np.zeros((0, 4)), *estimator.asked])
        asked = asked[: len(asked) - len(result.commands)]
        assert result.n_checked == len(asked)
        n_unreliable = int((estimator.logits(asked) <= 0).sum())
        assert result.n_rejected + result.n_accepted_unreliable == n_unreliable


@several
@given(problems(), st.sampled_from([None, *KINDS]), weights, seeds)
def test_a_seed_names_one_plan(problem, kind, weights, seed):
    field, start, goals = problem
    for planner in planners_of(field):
        estimator = None if kind is None else kind(weights)
        seeded = planner(field, estimator, k=1.0, max_iterations=200, random_state=seed)
        assert_same_plan(seeded.plan(start, goals), seeded.plan(start, goals))


@several
@given(problems(), weights, st.integers(1, 60), seeds)
def test_no_more_samples_are_drawn_than_allowed(problem, weights, n, seed):
    field, start, goals = problem
    planner = BiasedRRT(field, Linear(weights), max_iterations=n, random_state=seed)
    result = planner.plan(start, goals)
    assert field.n_samples <= n
    assert result.status in (PlanStatus.SOLVED, PlanStatus.ITERATION_LIMIT)


@several
@given(problems(), st.sampled_from([None, *KINDS]), weights, seeds)
def test_a_time_limit_is_looked_at_before_the_first_round(problem, kind, weights, seed):
    field, start, goals = problem
    for planner in planners_of(field):
        estimator = None if kind is None else kind(weights)
        result = planner(field, estimator, time_limit=1e-9, random_state=seed).plan(start, goals)
        assert result.status is PlanStatus.TIME_LIMIT or len(result.tree) == 0


@several
@given(problems(), st.sampled_from([LinearWithProbabilities, LinearFast]), weights, seeds)
def test_shortcuts_never_make_a_plan_less_likely_to_go_well(problem, kind, weights, seed):
    field, start, goals = problem
    for planner in planners_of(field):
        parameters = {"k": 0.5, "max_iterations": 400, "random_state": seed}
        found, shortened = (
            planner(field, kind(weights), simplify=simplify, **parameters).plan(start, goals)
            for simplify in (False, True)
        )
        assert shortened.success_probability >= found.success_probability * (1 - 1e-9)
        assert len(shortened.commands) <= len(found.commands)


@given(seeds, st.integers(1, 40), st.floats(-np.pi, np.pi))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_where_an_angle_wraps_makes_no_difference(seed, n_iterations, shift):
    """A turned problem has the same plan, turned."""
    plans = []
    for turned in (0.0, shift):
        field = Field([], turns=True, shift=turned)
        start, goal = (wrap_columns(np.array([[x, turned]]), (1,)) for x in (-0.9, 0.9))
        planner = BiasedRRT(field, simplify=False, max_iterations=n_iterations, random_state=seed)
        plans.append(planner.plan(start[0], goal))
    one, other = plans
    assert one.status is other.status
    assert one.tree.shape == other.tree.shape
    gaps = shortest_way(one.tree + np.array([0, shift]), other.tree, (1,))
    np.testing.assert_allclose(gaps, 0, atol=1e-9)
    np.testing.assert_allclose(one.commands, other.commands, atol=1e-9)


@given(st.integers(0, 1000), st.booleans())
@settings(max_examples=50, deadline=None, derandomize=True)
def test_the_nearest_node_is_the_nearest(seed, turns):
    rng = np.random.default_rng(seed)
    nodes, queries = (rng.uniform(-np.pi, np.pi, (n, 3)) for n in (20, 6))
    angular = (0, 2) if turns else ()
    tree = SearchTree(nodes[:5], 3, angular)
    tree.add(nodes[5:], np.zeros(15, dtype=int))
    distances = np.linalg.norm(shortest_way(queries[:, None], nodes[None], angular), axis=2)
    np.testing.assert_array_equal(tree.nearest(queries), distances.argmin(axis=1))


def test_a_steer_that_never_arrives_does_not_search_for_ever():
    class Misled(Field):
        def steer(self, reduced, configuration):
            return np.tile([0.0, 0.5], (len(reduced), 1))

    misled = BiasedRRT(Misled(turns=True), max_iterations=30, random_state=0)
    assert misled.plan([-0.9, 0.0], [0.9, 0.0]).status is PlanStatus.ITERATION_LIMIT
