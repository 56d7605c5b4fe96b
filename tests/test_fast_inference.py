"""Compiled classifiers answer as their public methods do, through whatever is around them."""

import doctest
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sklearn.base import clone
from sklearn.calibration import CalibratedClassifierCV
from sklearn.decomposition import PCA
from sklearn.ensemble import (
    ExtraTreesClassifier,
    HistGradientBoostingClassifier,
    RandomForestClassifier,
    VotingClassifier,
)
from sklearn.frozen import FrozenEstimator
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import (
    FixedThresholdClassifier,
    GridSearchCV,
    RandomizedSearchCV,
    TunedThresholdClassifierCV,
)
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import MaxAbsScaler, MinMaxScaler, RobustScaler, StandardScaler
from sklearn.tree import DecisionTreeClassifier, ExtraTreeClassifier
from threadpoolctl import threadpool_limits

from reliability import (
    MLP,
    FastHistGradientBoostingClassifier,
    TransitionReliabilityClassifier,
    compile_inference,
)
from reliability.fast_inference import compiling
from reliability.fast_inference.scaling_kernel import scaled_rows
from reliability.fast_inference.tree_kernels import LEAF, NODE, leaf_sums

N_FEATURES = 4
TREE = DecisionTreeClassifier(max_depth=6, random_state=0)
FOREST = RandomForestClassifier(7, random_state=0)
BOOSTING = HistGradientBoostingClassifier(max_iter=6, min_samples_leaf=5, random_state=0)
OURS = TransitionReliabilityClassifier(MLP((8,)), max_epochs=3, batch_size=32, random_state=0)

MODELS = {
    "tree": TREE,
    "extra tree": ExtraTreeClassifier(max_depth=6, random_state=0),
    "forest": FOREST,
    "two trees": RandomForestClassifier(2, max_depth=3, random_state=0),
    "extra trees": ExtraTreesClassifier(7, random_state=0),
    "boosting": BOOSTING,
    "fast boosting": FastHistGradientBoostingClassifier(max_iter=6, random_state=0),
    "ours": OURS,
}
WRAPPERS = {
    "alone": lambda model: model,
    "standard": lambda model: make_pipeline(StandardScaler(), model),
    "not centred": lambda model: make_pipeline(StandardScaler(with_mean=False), model),
    "two scalers": lambda model: make_pipeline(
        "passthrough", StandardScaler(with_std=False), None, MinMaxScaler((-1, 3)), model
    ),
    "clipped": lambda model: make_pipeline(MinMaxScaler(clip=True), model),
    "robust": lambda model: make_pipeline(RobustScaler(), model),
    "largest": lambda model: make_pipeline(MaxAbsScaler(), model),
    "grid": lambda model: GridSearchCV(model, {"random_state": [1]}, cv=2),
    "random": lambda model: RandomizedSearchCV(model, {"random_state": [1]}, n_iter=1, cv=2),
    "fixed": lambda model: FixedThresholdClassifier(model, threshold=0.3),
    "fixed, first": lambda model: FixedThresholdClassifier(model, threshold=0.6, pos_label=0),
    "fixed, as it is": lambda model: FixedThresholdClassifier(model),
    "tuned": lambda model: TunedThresholdClassifierCV(model, cv=2),
    "sigmoid": lambda model: CalibratedClassifierCV(model, cv=2),
    "one sigmoid": lambda model: CalibratedClassifierCV(model, cv=2, ensemble=False),
    "isotonic": lambda model: CalibratedClassifierCV(model, cv=2, method="isotonic"),
    "all": lambda model: FixedThresholdClassifier(
        CalibratedClassifierCV(
            GridSearchCV(
                make_pipeline(StandardScaler(), FixedThresholdClassifier(model, threshold=0.7)),
                {},
                cv=2,
            ),
            method="isotonic",
            cv=2,
        ),
        threshold=0.4,
    ),
}
RESPONDING = ("fixed", "fixed, first", "tuned", "sigmoid", "isotonic", "all")
# The network is slow to fit; what is around it does not depend on it.
COMBINATIONS = [
    (model, wrapper)
    for model in MODELS
    for wrapper in WRAPPERS
    if model == "boosting"
    or wrapper == "alone"
    or (model == "forest" and wrapper in ("standard", "grid", *RESPONDING))
    or (model == "ours" and wrapper in ("standard", "fixed", "sigmoid", "isotonic"))
]


@pytest.fixture(autouse=True, scope="module")
def one_thread():
    with threadpool_limits(1, user_api="openmp"):
        yield


def training_data(dtype=np.float64):
    """Half of the features are whole numbers, so that thresholds are met exactly."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(300, N_FEATURES))
    X[:, 2:] = rng.integers(0, 6, size=(300, 2))
    y = (X[:, 0] * X[:, 1] + 0.3 * X[:, 2] + 0.5 * rng.normal(size=300) > 0.6).astype(int)
    return X.astype(dtype), y


FITTED = {}


def fitted(model, wrapper="alone", dtype=np.float64):
    key = model, wrapper, dtype
    if key not in FITTED:
        FITTED[key] = WRAPPERS[wrapper](clone(MODELS[model])).fit(*training_data(dtype))
    return FITTED[key]


def critical_values():
    """Values at which trees decide, and their closest neighbours in both precisions."""
    X, _ = training_data()
    values = [0.0, -0.0, 1e30, -1e30]
    for column in X[:60].T:
        ordered = np.unique(column)
        values += [*ordered, *(ordered[1:] / 2 + ordered[:-1] / 2)]
    values = np.array(values)
    single = values.astype(np.float32).astype(np.float64)
    near = [np.nextafter(values, np.inf), np.nextafter(single.astype(np.float32), np.float32(9e9))]
    return np.concatenate([values, single, *near])


VALUES = critical_values()


def thresholds(model):
    if hasattr(model, "_predictors"):
        return np.concatenate([trees[0].nodes["num_threshold"] for trees in model._predictors])
    trees = getattr(model, "estimators_", [model])
    return np.concatenate([tree.tree_.threshold for tree in trees])


def assert_same_answers(estimator, rows):
    inference = compile_inference(estimator)
    assert inference is not None
    scores = inference.score(rows)
    predicted = np.asarray(estimator.classes_)[inference.is_second(scores).astype(int)]
    np.testing.assert_array_equal(predicted, estimator.predict(rows))
    probabilities = estimator.predict_proba(rows)
    for column in range(2):
        given = inference.probability(scores, column)
        assert given.dtype == np.float64
        np.testing.assert_array_equal(given, probabilities[:, column])
    assert (inference.decision is not None) == hasattr(estimator, "decision_function")
    if inference.decision is not None:
        decisions = estimator.decision_function(rows)
        np.testing.assert_array_equal(inference.decision(scores), decisions)


@pytest.mark.parametrize(("model", "wrapper"), COMBINATIONS)
def test_answers_are_those_of_the_public_methods(model, wrapper):
    pool = VALUES[np.abs(VALUES) < 1e3] if model == "ours" else VALUES

    @settings(derandomize=True, deadline=None, max_examples=8)
    @given(
        arrays(np.intp, (16, N_FEATURES), elements=st.integers(0, len(pool) - 1)),
        st.sampled_from([np.float64, np.float32]),
    )
    def check(chosen, dtype):
        assert_same_answers(fitted(model, wrapper), pool[chosen].astype(dtype))

    check()
    assert_same_answers(fitted(model, wrapper), training_data()[0])


@pytest.mark.parametrize("model", ["tree", "forest", "extra trees", "boosting"])
def test_at_a_threshold_trees_go_left(model):
    estimator = fitted(model)
    values = thresholds(estimator)
    values = np.concatenate([values, np.nextafter(values, np.inf), np.nextafter(values, -np.inf)])
    chosen = np.random.default_rng(0).integers(len(values), size=(2000, N_FEATURES))
    assert_same_answers(estimator, values[chosen])
    assert_same_answers(estimator, values[chosen].astype(np.float32))


@pytest.mark.parametrize("dtype", [np.uint8, np.int64, np.float32])
@pytest.mark.parametrize("wrapper", ["alone", "standard", "clipped", "robust", "largest"])
@pytest.mark.parametrize("model", ["forest", "boosting"])
def test_any_type_of_number(model, wrapper, dtype):
    rows = np.abs(10 * training_data()[0]).astype(dtype)
    estimator = fitted(model, wrapper, np.float32)
    assert_same_answers(estimator, rows)
    assert_same_answers(estimator, np.asfortranarray(rows)[::2])
    assert len(compile_inference(estimator).score(rows[:0])) == 0


def test_single_precision_is_kept_through_scalers():
    X, y = training_data(np.float32)
    for scaler in (StandardScaler(), MinMaxScaler(), RobustScaler(), MaxAbsScaler()):
        pipeline = make_pipeline(scaler, clone(BOOSTING)).fit(X + 1000, y)
        assert_same_answers(pipeline, X + np.float32(1000))


@pytest.mark.parametrize("model", ["tree", "forest", "extra trees", "boosting"])
@pytest.mark.parametrize("wrapper", ["alone", "standard", "isotonic"])
def test_missing_values(model, wrapper):
    X, y = training_data()
    X[np.random.default_rng(1).random(X.shape) < 0.2] = np.nan
    estimator = WRAPPERS[wrapper](clone(MODELS[model])).fit(X, y)
    assert_same_answers(estimator, X)
    whole = fitted(model, wrapper)
    assert_same_answers(whole, X)


@pytest.mark.parametrize("value", [np.inf, -np.inf])
def test_infinite_values_are_refused_where_the_public_methods_refuse_them(value):
    rows = training_data()[0][:3].copy()
    rows[1, 0] = value
    assert_same_answers(fitted("boosting"), rows)
    refusing = [fitted("tree"), fitted("forest"), fitted("boosting", "standard")]
    for estimator in refusing:
        with pytest.raises(ValueError, match="infinit"):
            estimator.predict(rows)
        with pytest.raises(ValueError, match="infinit"):
            compile_inference(estimator).score(rows)


def test_rows_of_another_width_are_refused():
    for wrapper in ("alone", "standard"):
        with pytest.raises(ValueError, match="fitted on 4 features, got 3"):
            compile_inference(fitted("forest", wrapper)).score(np.zeros((2, 3)))


def test_of_equally_likely_classes_the_first_is_predicted():
    X, y = np.zeros((40, 1)), np.arange(40) % 2
    tree = DecisionTreeClassifier().fit(X, y)
    assert tree.predict_proba(X)[0].tolist() == [0.5, 0.5]
    for estimator in (
        tree,
        RandomForestClassifier(4, bootstrap=False).fit(X, y),
        FixedThresholdClassifier(tree).fit(X, y),
        FixedThresholdClassifier(tree, pos_label=0).fit(X, y),
        CalibratedClassifierCV(FrozenEstimator(tree)).fit(X, y),
    ):
        assert_same_answers(estimator, X)


@pytest.mark.parametrize("method", ["auto", "decision_function"])
@pytest.mark.parametrize("positive", ["reliable", "unreliable"])
@pytest.mark.parametrize("threshold", ["auto", -0.4, 0.45])
def test_thresholds_of_either_response_and_class(method, positive, threshold):
    X, y = training_data()
    names = np.where(y == 1, "reliable", "unreliable")
    wrapper = FixedThresholdClassifier(
        clone(BOOSTING), threshold=threshold, pos_label=positive, response_method=method
    )
    assert_same_answers(wrapper.fit(X, names), X)


def test_thresholds_around_what_is_fitted_already():
    X, y = training_data()
    assert_same_answers(FixedThresholdClassifier(clone(FOREST).fit(X, y), threshold=0.2), X)
    frozen = FrozenEstimator(clone(OURS).fit(X, y))
    assert_same_answers(FixedThresholdClassifier(frozen, threshold=0.8).fit(X, y), X)
    assert_same_answers(CalibratedClassifierCV(frozen, method="isotonic").fit(X, y), X)


class Strict(RandomForestClassifier):
    def predict(self, X):
        return (self.predict_proba(X)[:, 1] > 0.9).astype(int)


class StrictBoosting(HistGradientBoostingClassifier):
    def predict(self, X):
        return (self.predict_proba(X)[:, 1] > 0.9).astype(int)


class StrictOurs(TransitionReliabilityClassifier):
    def predict(self, X):
        return (self.predict_proba(X)[:, 1] > 0.9).astype(int)


class OnlyNamed(HistGradientBoostingClassifier):
    """Adds nothing."""


class Halves:
    """Fast, with decisions that are not its log-odds."""

    classes_ = np.array([0, 1])
    n_features_in_ = N_FEATURES

    def fit(self, X, y):
        return self

    def predict(self, X):
        return (np.asarray(X)[:, 0] > 0).astype(int)

    def predict_proba(self, X):
        return np.column_stack([1 - self.predict(X), self.predict(X)])

    def fast_decision_function(self, X):
        return 0.01 * np.asarray(X)[:, 0]


def test_what_is_not_known_is_left_to_the_public_methods():
    X, y = training_data()
    whole = X.copy()
    whole[:, 2] = np.abs(whole[:, 2])
    left_alone = [
        None,
        object(),
        clone(FOREST),
        clone(OURS),
        make_pipeline(StandardScaler(), clone(FOREST)),
        make_pipeline(StandardScaler(), clone(FOREST).fit(X, y)),
        LogisticRegression().fit(X, y),
        make_pipeline(PCA(2), clone(FOREST)).fit(X, y),
        make_pipeline(StandardScaler(), LogisticRegression()).fit(X, y),
        CalibratedClassifierCV(LogisticRegression(), cv=2).fit(X, y),
        GridSearchCV(LogisticRegression(), {}, cv=2).fit(X, y),
        GridSearchCV(clone(TREE), {}, cv=2, refit=False).fit(X, y),
        FixedThresholdClassifier(LogisticRegression()).fit(X, y),
        VotingClassifier([("forest", clone(FOREST))]).fit(X, y),
        clone(FOREST).fit(X, np.column_stack([y, 1 - y])),
        clone(FOREST).fit(X, np.arange(len(y)) % 3),
        clone(FOREST).fit(X, np.ones(len(y))),
        HistGradientBoostingClassifier(max_iter=2, categorical_features=[2]).fit(whole, y),
        Strict(3).fit(X, y),
        StrictBoosting(max_iter=2).fit(X, y),
        StrictOurs(MLP((4,)), max_epochs=1).fit(X, y),
        make_pipeline(StandardScaler(), Strict(3)).fit(X, y),
        FixedThresholdClassifier(Halves()),
        FixedThresholdClassifier(clone(FOREST), response_method="decision_function", threshold=0),
    ]
    assert [each for each in left_alone if compile_inference(each) is not None] == []
    assert compile_inference(OnlyNamed(max_iter=2).fit(X, y)) is not None


def test_a_fast_method_of_ones_own_is_used():
    inference = compile_inference(
        make_pipeline(StandardScaler(with_mean=False), Halves()).fit(
            [[1, 1, 1, 1], [3, 3, 3, 3]], [0, 1]
        )
    )
    assert inference.is_second(
        inference.score(np.array([[2.0, 0, 0, 0], [-1.0, 0, 0, 0]]))
    ).tolist() == [True, False]
    assert not inference.scores_are_public


@pytest.mark.parametrize(
    "make",
    [
        lambda n: RandomForestClassifier(n, warm_start=True, random_state=0),
        lambda n: HistGradientBoostingClassifier(max_iter=n, warm_start=True, random_state=0),
    ],
)
def test_what_is_fitted_again_is_compiled_again(make):
    X, y = training_data()
    model = make(3).fit(X, y)
    assert_same_answers(model, X)
    longer = make(6).get_params()
    model.set_params(**longer).fit(X, y)
    assert_same_answers(model, X)
    model.set_params(warm_start=False).fit(X, 1 - y)
    assert_same_answers(model, X)


@pytest.mark.parametrize("wrapper", ["alone", "all"])
@pytest.mark.parametrize("model", ["forest", "fast boosting"])
def test_nothing_compiled_is_pickled(model, wrapper):
    X, y = training_data()
    estimator = WRAPPERS[wrapper](clone(MODELS[model])).fit(X, y)
    before = pickle.dumps(estimator)
    assert_same_answers(estimator, X)
    assert pickle.dumps(estimator) == before
    assert_same_answers(pickle.loads(before), X)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("left", 10**6),
        ("right", 10**6),
        ("left", 0),
        ("feature_idx", 4),
        ("feature_idx", -1),
    ],
)
def test_damaged_trees_are_refused(field, value):
    X, y = training_data()
    model = clone(BOOSTING).fit(X, y)
    model._predictors[2][0].nodes[field][0] = value
    with pytest.raises(ValueError, match="HistGradientBoostingClassifier is damaged"):
        compile_inference(model)


def test_the_example_of_the_docstring_runs():
    results = doctest.testmod(compiling)
    assert results.attempted > 0
    assert results.failed == 0


def test_the_kernel_walks_as_plain_python_does(rng):
    nodes = np.zeros(7, dtype=NODE)
    nodes["feature"] = [0, 1, LEAF, LEAF, LEAF, 1, LEAF]
    nodes["threshold"] = rng.normal(size=7)
    nodes["left"] = [1, 2, 0, 1, 2, 6, 3]
    nodes["right"] = [4, 3, -1, -1, -1, 4, -1]
    nodes["missing_goes_left"] = [True, False, False, False, False, True, False]
    values = rng.normal(size=(4, 2))
    rows = rng.normal(size=(50, 2))
    rows[rng.random(rows.shape) < 0.2] = np.nan
    rows[0] = nodes["threshold"][:2]

    def walked(row):
        total = np.full(2, 0.5)
        for node in (0, 5):
            while nodes[node]["feature"] != LEAF:
                value = row[nodes[node]["feature"]]
                left = (
                    nodes[node]["missing_goes_left"]
                    if np.isnan(value)
                    else value <= nodes[node]["threshold"]
                )
                node = nodes[node]["left" if left else "right"]
            total = total + values[nodes[node]["left"]]
        return total

    given = leaf_sums(rows, 0.5, np.array([0, 5]), nodes, values)
    np.testing.assert_array_equal(given, [walked(row) for row in rows])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_kernel_scales_as_numpy_does(rng, dtype):
    rows = rng.normal(size=(40, 3)).astype(dtype)
    rows[3, 1] = np.nan
    subtract, divide, multiply, add = rng.uniform(0.5, 2, size=(4, 3))
    expected = rows.copy()
    expected -= subtract
    expected /= divide
    expected *= multiply
    expected += add
    np.clip(expected, -1.0, 1.5, out=expected)
    given = scaled_rows(rows, subtract, divide, multiply, add, -1.0, 1.5)
    assert given.dtype == dtype
    np.testing.assert_array_equal(given, expected)
