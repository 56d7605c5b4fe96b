"""Boosted trees that answer fast say what scikit-learn's say."""

import pickle

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.model_selection import cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks
from threadpoolctl import threadpool_limits
from toy_systems import Disc

from planners import BiasedRRT, BiasedRRTConnect
from reliability import FastHistGradientBoostingClassifier, load_estimator


@pytest.fixture(autouse=True, scope="module")
def one_thread():
    with threadpool_limits(1, user_api="openmp"):
        yield


def expected_failures(estimator):
    # As for scikit-learn's own: bins depend on how often a row is repeated.
    return {"check_sample_weight_equivalence_on_dense_data": "bins depend on repeated rows"}


@parametrize_with_checks(
    [FastHistGradientBoostingClassifier(max_iter=5, min_samples_leaf=5)],
    expected_failed_checks=expected_failures,
)
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.SkipTestWarning")
def test_scikit_learns_own_checks(estimator, check):
    check(estimator)


def data(rng, n=2000, missing=0.1):
    X = rng.normal(size=(n, 5))
    X[:, 4] = rng.integers(6, size=n)
    score = X[:, 0] * X[:, 1] + np.sin(X[:, 4]) + 0.3 * rng.normal(size=n)
    y = (score > 0).astype(int)
    X[rng.random(X.shape) < missing] = np.nan
    return X, y


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("missing", [0.0, 0.1])
def test_both_ways_give_the_same_bits(rng, dtype, missing):
    X, y = data(rng, missing=missing)
    model = FastHistGradientBoostingClassifier(max_iter=20, random_state=0).fit(X.astype(dtype), y)
    plain = HistGradientBoostingClassifier(max_iter=20, random_state=0).fit(X.astype(dtype), y)
    rows = np.concatenate([X, data(rng, missing=0.5)[0]]).astype(dtype)
    rows[:20, 0], rows[20:40, 1] = np.inf, -np.inf
    rows[100:1000, 4] += 0.5  # where whole numbers are parted
    fast = model.fast_decision_function(rows)
    np.testing.assert_array_equal(fast, plain.decision_function(rows))
    np.testing.assert_array_equal(fast, model.decision_function(rows))
    np.testing.assert_array_equal(model.classes_[(fast > 0).astype(int)], model.predict(rows))
    assert len(model.fast_decision_function(rows[:0])) == 0
    strided = model.fast_decision_function(np.asfortranarray(rows)[::2])
    np.testing.assert_array_equal(strided, fast[::2])


def test_another_fit_is_another_model(rng):
    X, y = data(rng)
    model = FastHistGradientBoostingClassifier(max_iter=3, warm_start=True).fit(X, y)
    before = model.fast_decision_function(X)
    model.set_params(max_iter=6).fit(X, y)
    after = model.fast_decision_function(X)
    assert not np.array_equal(before, after)
    np.testing.assert_array_equal(after, model.decision_function(X))


def test_it_is_kept_and_cloned_as_any_estimator(rng, tmp_path):
    X, y = data(rng)
    model = FastHistGradientBoostingClassifier(max_iter=20).fit(X, y)
    size = len(pickle.dumps(model))
    expected = model.fast_decision_function(X)
    assert len(pickle.dumps(model)) == size, "what is rebuilt from the trees is not kept"
    (tmp_path / "model").write_bytes(pickle.dumps(model))
    again = load_estimator(tmp_path / "model")
    np.testing.assert_array_equal(again.fast_decision_function(X), expected)
    assert not hasattr(clone(model), "classes_")
    scores = cross_val_score(make_pipeline(StandardScaler(), clone(model)), X, y, cv=3)
    assert scores.min() > 0.7


def test_what_it_cannot_answer_fast_is_left_to_scikit_learn(rng):
    X, y = data(rng, missing=0.0)
    unfitted = FastHistGradientBoostingClassifier(max_iter=2)
    assert not hasattr(unfitted, "fast_decision_function")
    three = clone(unfitted).fit(X, np.arange(len(y)) % 3)
    assert not hasattr(three, "fast_decision_function")
    X[:, 2] = rng.integers(4, size=len(X))
    categories = FastHistGradientBoostingClassifier(max_iter=2, categorical_features=[2]).fit(X, y)
    assert not hasattr(categories, "fast_decision_function")
    assert categories.predict(X[:3]).shape == (3,)


@pytest.mark.parametrize("planner", [BiasedRRT, BiasedRRTConnect])
def test_planners_ask_it_fast(rng, planner):
    disc = Disc()
    reduced = disc.sample_configurations(rng, 4000)
    following = np.clip(reduced + rng.uniform(-0.07, 0.07, reduced.shape), *disc.bounds)
    X = disc.features(reduced, following)
    y = (np.linalg.norm(following - disc.bounds.mean(axis=0), axis=1) > 0.2).astype(int)
    model = FastHistGradientBoostingClassifier(max_iter=20).fit(X, y)
    asked = []
    model.decision_function = model.predict_proba = model.predict = asked.append
    problem = disc.sample_problem(0)
    plan = planner(disc, model, accuracy=0.9, random_state=0).plan(
        disc.reduce(problem.start), problem.goal
    )
    assert plan.success
    assert plan.n_checked > 0
    assert not asked
