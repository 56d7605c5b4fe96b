"""The one place that asks estimators: what it takes, and what it refuses to believe."""

import warnings

import joblib
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.calibration import CalibratedClassifierCV
from sklearn.compose import make_column_transformer
from sklearn.dummy import DummyClassifier
from sklearn.ensemble import HistGradientBoostingClassifier, RandomForestClassifier
from sklearn.linear_model import LogisticRegression, SGDClassifier
from sklearn.model_selection import FixedThresholdClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from test_planners import assert_same_plan
from threadpoolctl import threadpool_limits
from toy_systems import Disc

from planners import BiasedRRT, BiasedRRTConnect, CheckTransition

NAMES = ["x", "y", "east", "north"]


@pytest.fixture(autouse=True, scope="module")
def one_thread():
    with threadpool_limits(1, user_api="openmp"):
        yield


def checker(estimator, k=np.inf, system=None):
    rng = np.random.default_rng(0)
    return CheckTransition(system or Disc(), estimator, k=k, accuracy=0.9, rng=rng)


def transitions(n=3, seed=0):
    rng = np.random.default_rng(seed)
    reduced = rng.uniform(-1, 1, size=(n, 2))
    return reduced, reduced + rng.uniform(-0.07, 0.07, size=(n, 2))


class Says:
    """Returns what it is told to, by whatever method it is asked."""

    def __init__(self, predict, predict_proba=None, classes=(0, 1)):
        self.classes_ = np.array(classes)
        self.answer = predict
        if predict_proba is not None:
            self.predict_proba = lambda X: predict_proba

    def predict(self, X):
        return self.answer


class SaysFast(Says):
    def fast_decision_function(self, X):
        return self.answer


@pytest.mark.parametrize(
    ("estimator", "expected"),
    [
        (Says([1, 0, 1]), [1, 0, 1]),
        (Says(np.array([[1], [0], [1]])), [1, 0, 1]),
        (Says(pd.Series([1, 0, 1], index=[7, 8, 9])), [1, 0, 1]),
        (Says(np.array([1.0, 0.0, 1.0])), [1, 0, 1]),
        (Says(np.array([True, False, True])), [1, 0, 1]),
        (Says(["bad", "good", "good"], classes=["good", "bad"]), None),
        (
            Says(["Reliable", "unreliable", "Reliable"], classes=["Reliable", "unreliable"]),
            [1, 0, 1],
        ),
        (
            Says(np.array(["reliable"] * 3, dtype=object), classes=["unreliable", "reliable"]),
            [1, 1, 1],
        ),
        (Says([0, 1, 1], classes=[1, 0]), [0, 1, 1]),
        (SaysFast(np.array([1.0, -1.0, np.inf])), [1, 0, 1]),
        (SaysFast(np.array([1.0, -1.0, np.inf]), classes=[1, 0]), [0, 1, 0]),
        (SaysFast(np.array([[0.5], [0.0], [-0.5]])), [1, 0, 0]),
        (SaysFast(np.array([2, -3, 0])), [1, 0, 0]),
    ],
)
def test_unambiguous_answers_are_taken(estimator, expected):
    if expected is None:
        with pytest.raises(ValueError, match=r"must have the classes .*, got \['good', 'bad'\]"):
            checker(estimator)
        return
    check = checker(estimator)
    assert check.classify(*transitions()).tolist() == [bool(label) for label in expected]
    assert check(*transitions()).tolist() == [bool(label) for label in expected]


@pytest.mark.parametrize(
    ("estimator", "message"),
    [
        (
            Says(np.array(["True", "False", "True"]), classes=[False, True]),
            r"Says.predict must return labels .*\[False, True\], and returned 'True', 'False'\.",
        ),
        (Says([0.3, 0.9, 1.0]), r"Says.predict must return labels from .*returned 0.3, 0.9\."),
        (Says([1, np.nan, 0]), r"Says.predict must return labels .* returned nan"),
        (Says([None, None, 1]), r"Says.predict must return labels .* returned None"),
        (Says([1, 2, 0]), r"Says.predict must return labels .* returned 2"),
        (Says(["Reliable"] * 3, classes=["reliable", "unreliable"]), "returned 'Reliable'"),
        (Says([1, 0]), r"Says.predict must return one answer for each of 3 rows.*shape \(2,\)"),
        (Says(1), r"one answer for each of 3 rows.*shape \(\)"),
        (Says(None), r"one answer for each of 3 rows"),
        (Says(np.zeros((3, 2))), r"one answer for each of 3 rows.*shape \(3, 2\)"),
        (SaysFast([1.0, np.nan, 1.0]), "SaysFast, compiled, returned NaN in 1 of 3 places"),
        (SaysFast([1.0, 2.0]), r"SaysFast.fast_decision_function must return one answer for each"),
        (SaysFast(np.zeros((3, 2))), r"SaysFast.fast_decision_function must return one answer"),
        (SaysFast(["a", "b", "c"]), "SaysFast, compiled, must return numbers"),
    ],
)
def test_what_is_no_label_is_refused(estimator, message):
    check = checker(estimator)
    for ask in (check, check.classify, check.evaluate, check.probability):
        with pytest.raises(ValueError, match=message):
            ask(*transitions())


HALF = np.full((3, 2), 0.5)


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (HALF[:, :1], r"Says.predict_proba must return a column .* 2 classes .* shape \(3, 1\)"),
        (HALF[:, 0], r"Says.predict_proba must return a column .* shape \(3,\)"),
        (HALF[:2], r"row for each of 3 transitions, .* shape \(2, 2\)"),
        ([HALF, HALF], r"shape \(2, 3, 2\)"),
        (np.full((3, 2), np.nan), "Says.predict_proba must return probabilities .* returned nan"),
        (np.array([[0.5, 0.5], [-6.0, 7.0], [0, 1]]), "between 0 and 1, and returned -6.0"),
        (np.array([[0.5, 0.5], [0.9, 1.1], [0, 1]]), "between 0 and 1, and returned 1.1"),
        (HALF.astype(str), "must return a column of numbers"),
        (np.full((3, 2), 0.9), "probabilities that add up to 1, .* add up to 1.8"),
    ],
)
def test_what_is_no_probability_is_refused(returned, message):
    check = checker(Says([1, 1, 0], returned))
    assert check.classify(*transitions()).tolist() == [True, True, False]
    for ask in (check.evaluate, check.probability):
        with pytest.raises(ValueError, match=message):
            ask(*transitions())


def test_probabilities_are_read_from_the_column_of_the_reliable_class():
    table = np.array([[0.2, 0.8], [1.0 + 1e-9, -1e-9], [0.7, 0.3]])
    assert checker(Says([1, 1, 0], table)).probability(*transitions()).tolist() == [0.8, 0.0, 0.3]
    swapped = checker(Says([1, 1, 0], table, classes=[1, 0]))
    assert swapped.probability(*transitions()).tolist() == [0.2, 1.0, 0.7]


def test_a_plan_is_not_made_with_an_estimator_that_returns_nonsense():
    for planner in (BiasedRRT, BiasedRRTConnect):
        with pytest.raises(ValueError, match="returned nan"):
            planner(Disc(), Undecided(), accuracy=0.9).plan([-0.9, 0.0], [0.9, 0.0])


class Undecided(Says):
    def __init__(self):
        super().__init__(None)

    def predict(self, X):
        return np.full(len(X), np.nan)


def data(n=400):
    reduced, following = transitions(n, seed=1)
    X = Disc().features(reduced, following)
    return X, (X[:, 0] + 0.5 * np.random.default_rng(2).normal(size=n) < 0.2).astype(int)


FOREST = RandomForestClassifier(8, max_depth=4, random_state=0)
BOOSTING = HistGradientBoostingClassifier(max_iter=10, random_state=0)
KINDS = {
    "forest": FOREST,
    "boosting": BOOSTING,
    "linear": LogisticRegression(),
    "without probabilities": SGDClassifier(random_state=0),
    "pipeline": make_pipeline(StandardScaler(), BOOSTING),
    "low threshold": FixedThresholdClassifier(FOREST, threshold=0.1),
    "high threshold": FixedThresholdClassifier(BOOSTING, threshold=0.8),
    "high threshold, public": FixedThresholdClassifier(LogisticRegression(), threshold=0.8),
    "calibrated": CalibratedClassifierCV(BOOSTING, cv=2),
    "constant": DummyClassifier(strategy="constant", constant=1),
}
CODINGS = {
    "numbers": ([0, 1], 1),
    "booleans": ([False, True], True),
    "names": (["unreliable", "reliable"], "reliable"),
    "capitals": (["Unreliable", "Reliable"], "Reliable"),
}


@pytest.fixture(scope="module", params=CODINGS)
def coding(request):
    return CODINGS[request.param]


@pytest.fixture(params=KINDS)
def estimator(request, coding):
    labels, reliable = coding
    model = KINDS[request.param]
    if request.param == "constant":
        model.set_params(constant=reliable)
    elif "threshold" in request.param:
        model.set_params(pos_label=reliable)
    X, y = data()
    return model.fit(X, np.array(labels)[y])


def test_each_way_of_asking_says_what_the_estimator_says(estimator, coding):
    reliable = coding[1]
    before, after = transitions(300)
    rows = Disc().features(before, after)
    check = checker(estimator)
    expected = estimator.predict(rows) == reliable
    np.testing.assert_array_equal(check.classify(before, after), expected)
    np.testing.assert_array_equal(check(before, after), expected)
    if hasattr(estimator, "predict_proba"):
        column = list(estimator.classes_).index(reliable)
        probability = estimator.predict_proba(rows)[:, column]
    else:
        probability = expected.astype(float)
    given = check.probability(before, after)
    np.testing.assert_allclose(given, probability, rtol=0, atol=1e-12)
    for n in (300, 1, 0):
        together = check.evaluate(before[:n], after[:n])
        np.testing.assert_array_equal(together[0], expected[:n])
        np.testing.assert_array_equal(together[1], given[:n])
    assert check.n_checked == 300 + 300 + 301
    assert check.n_rejected == np.count_nonzero(~expected)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.lists(st.floats(0, 1), min_size=1, max_size=6), st.floats(0, 1))
def test_predict_decides_and_not_the_probability(probabilities, threshold):
    second = np.array(probabilities)

    class Threshold(Says):
        def predict(self, X):
            return (second >= threshold).astype(int)

    check = checker(Threshold(None, np.column_stack([1 - second, second])))
    reliable, probability = check.evaluate(*transitions(len(second)))
    np.testing.assert_array_equal(reliable, second >= threshold)
    np.testing.assert_array_equal(probability, second)


def test_a_subclass_is_asked_through_its_own_predict():
    class Strict(RandomForestClassifier):
        def predict(self, X):
            return (self.predict_proba(X)[:, 1] > 0.9).astype(int)

    model = Strict(8, max_depth=4, random_state=0).fit(*data())
    before, after = transitions(200)
    expected = model.predict(Disc().features(before, after)) == 1
    assert 0 < expected.sum() < (FOREST.fit(*data()).predict(data()[0]) == 1).sum()
    np.testing.assert_array_equal(checker(model).classify(before, after), expected)


def test_no_transitions_are_no_question():
    class Offended(Says):
        def predict(self, X):
            raise AssertionError("asked about nothing")

        predict_proba = predict

    class OffendedFast(Offended):
        fast_decision_function = Offended.predict

    nothing = np.empty((0, 2)), np.empty((0, 2))
    for estimator in (None, Offended([]), OffendedFast([]), FOREST.fit(*data())):
        check = checker(estimator)
        assert check(*nothing).shape == (0,)
        assert check.classify(*nothing).dtype == np.bool_
        assert check.probability(*nothing).shape == (0,)
        assert [part.shape for part in check.evaluate(*nothing)] == [(0,), (0,)]
        assert check.n_checked == 0


@pytest.mark.parametrize("label", [0, 1])
def test_an_estimator_of_one_class_is_not_asked(label):
    estimator = Says(None, classes=[label])
    check = checker(estimator)
    assert check.answers_fast
    assert check.classify(*transitions()).tolist() == [bool(label)] * 3
    reliable, probability = check.evaluate(*transitions())
    assert reliable.tolist() == [bool(label)] * 3
    assert probability.tolist() == [float(label)] * 3
    assert check.n_checked == 6


@pytest.mark.parametrize(
    "classes",
    [[0, 1, 2], [2], [1, 1], [0, True, False], [np.nan, 1], [], [None, 1], [[0, 1], [0, 1]]],
)
def test_other_classes_are_refused(classes):
    with pytest.raises(ValueError, match=r"must have the classes 1 \(Reliable\) and 0"):
        checker(Says(None, classes=classes))


def test_a_forest_of_several_outputs_is_refused():
    X, y = data()
    several = RandomForestClassifier(2).fit(X, np.column_stack([y, 1 - y]))
    with pytest.raises(ValueError, match="must have the classes 1"):
        checker(several)


@pytest.mark.parametrize(
    "estimator",
    [
        LogisticRegression(),
        FOREST,
        make_pipeline(StandardScaler(), LogisticRegression()),
        make_pipeline(StandardScaler(), FOREST),
        CalibratedClassifierCV(LogisticRegression(), cv=2),
        make_pipeline(
            make_column_transformer((StandardScaler(), ["x", "east"]), remainder="passthrough"),
            LogisticRegression(),
        ),
    ],
    ids=str,
)
def test_estimators_fitted_on_tables_with_names_are_asked_with_names(estimator):
    X, y = data()
    table = pd.DataFrame(X, columns=NAMES)
    estimator.fit(table, y)
    before, after = transitions(50)
    asked = pd.DataFrame(Disc().features(before, after), columns=NAMES)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        reliable, probability = checker(estimator).evaluate(before, after)
        planner = BiasedRRT(Disc(), estimator, k=10, accuracy=0.9, random_state=0)
        plan = planner.plan([-0.9, 0.1], [-0.5, 0.8])
    assert plan.success
    np.testing.assert_array_equal(reliable, estimator.predict(asked) == 1)
    np.testing.assert_array_equal(probability, estimator.predict_proba(asked)[:, 1])


def test_only_estimators_that_offer_it_are_asked_about_single_transitions():
    X, y = data()
    assert checker(None).answers_fast
    assert checker(SaysFast(None)).answers_fast
    for estimator in (FOREST.fit(X, y), BOOSTING.fit(X, y), LogisticRegression().fit(X, y)):
        assert not checker(estimator).answers_fast

    class InBatches(SaysFast):
        prefers_batches = True

    assert not checker(InBatches(None)).answers_fast


@pytest.mark.parametrize("estimator", [FOREST, make_pipeline(StandardScaler(), BOOSTING)], ids=str)
def test_planning_asks_trees_through_compiled_code(estimator, monkeypatch):
    estimator.fit(*data())

    def asked(*_, **__):
        raise AssertionError("asked through a public method")

    for kind in (RandomForestClassifier, HistGradientBoostingClassifier):
        for method in ("predict", "predict_proba", "decision_function"):
            if hasattr(kind, method):
                monkeypatch.setattr(kind, method, asked)
    plan = BiasedRRT(Disc(), estimator, accuracy=0.9, random_state=0).plan([-0.9, 0.1], [-0.5, 0.8])
    assert plan.success
    assert plan.n_checked > 0


def test_other_processes_make_the_same_plans():
    pipeline = make_pipeline(StandardScaler(), BOOSTING).fit(*data())
    planners = [BiasedRRT(Disc(), pipeline, accuracy=0.9, random_state=seed) for seed in range(4)]
    problem = [-0.9, 0.1], [-0.5, 0.8]
    here = [planner.plan(*problem) for planner in planners]
    elsewhere = joblib.Parallel(n_jobs=2)(joblib.delayed(each.plan)(*problem) for each in planners)
    for one, other in zip(here, elsewhere, strict=True):
        assert_same_plan(one, other)
