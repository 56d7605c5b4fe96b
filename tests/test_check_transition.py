"""Algorithm 1: who is asked, who is accepted, and what is refused."""

import numpy as np
import pytest
from sklearn.dummy import DummyClassifier
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import LogisticRegression
from toy_systems import Disc

from planners import BiasedRRTConnect, CheckTransition

N = 20_000


class RightIsUnreliable:
    """Distrusts transitions that start at x > 0; remembers what it was asked."""

    classes_ = np.array([0, 1])

    def __init__(self):
        self.asked = []

    def predict(self, X):
        self.asked.append(X.copy())
        return (X[:, 0] <= 0).astype(int)


def checker(estimator=None, k=1.0, accuracy=0.9, seed=0):
    rng = np.random.default_rng(seed)
    return CheckTransition(Disc(), estimator, k=k, accuracy=accuracy, rng=rng)


def rows(n_left, n_right):
    reduced = np.zeros((n_left + n_right, 2))
    reduced[:, 0] = np.where(np.arange(len(reduced)) < n_left, -1, 1)
    return reduced, reduced + 0.01


def test_reliable_transitions_are_always_accepted():
    check = checker(RightIsUnreliable(), k=np.inf)
    assert check(*rows(N, 0)).all()
    assert (check.n_checked, check.n_rejected, check.n_accepted_unreliable) == (N, 0, 0)


@pytest.mark.parametrize(("k", "accuracy"), [(1, 0.99), (2, 0.6), (5, 0.9), (0, 0.9)])
def test_unreliable_ones_are_accepted_with_the_papers_probability(k, accuracy):
    check = checker(RightIsUnreliable(), k=k, accuracy=accuracy)
    share = check(*rows(0, N)).mean()
    expected = np.exp(-k * accuracy)
    assert share == pytest.approx(expected, abs=4 * np.sqrt(expected * (1 - expected) / N) + 1e-12)
    assert check.n_accepted_unreliable == round(share * N)
    assert check.n_rejected == N - check.n_accepted_unreliable


def test_draws_are_independent_within_and_between_questions():
    check = checker(RightIsUnreliable(), k=1, accuracy=np.log(2))
    answers = np.array([check(*rows(0, 2)) for _ in range(4000)])
    assert np.abs(np.corrcoef(answers.T)[0, 1]) < 0.07
    assert np.abs(np.corrcoef(answers[1:, 0], answers[:-1, 0])[0, 1]) < 0.07


def test_infinite_k_rejects_every_unreliable_transition():
    assert not checker(RightIsUnreliable(), k=np.inf)(*rows(0, N)).any()
    assert not checker(RightIsUnreliable(), k=np.inf, accuracy=0.0)(*rows(0, N)).any()


def test_without_an_estimator_everything_is_accepted_and_nothing_counted():
    check = checker()
    assert check(*rows(5, 5)).all()
    assert check.probability(*rows(5, 5)).tolist() == [1.0] * 10
    assert check.n_checked == 0


def test_a_batch_is_one_question():
    estimator = RightIsUnreliable()
    checker(estimator)(*rows(30, 12))
    assert [len(asked) for asked in estimator.asked] == [42]


def fitted(estimator, y, n_features=4):
    X = np.random.default_rng(0).normal(size=(len(y), n_features))
    return estimator.fit(X, y)


@pytest.mark.parametrize(
    ("labels", "expected"),
    [
        ([0, 1], [0, 1]),
        ([False, True], [0, 1]),
        (["Reliable", "Unreliable"], [1, 0]),
        (["UNRELIABLE", "reliable"], [0, 1]),
        ([1], [1]),
        ([0], [0]),
        (["unreliable"], [0]),
    ],
)
def test_labels_mean_what_they_say(labels, expected):
    for label, reliable in zip(labels, expected, strict=True):
        training = (labels * 10)[:10] if len(labels) > 1 else labels * 10
        estimator = fitted(DummyClassifier(strategy="constant", constant=label), training)
        check = checker(estimator, k=np.inf)
        assert check.classify(*rows(2, 1)).tolist() == [bool(reliable)] * 3
        np.testing.assert_allclose(check.probability(*rows(2, 1)), reliable)


def test_accuracy_comes_from_the_estimator_unless_given(arm_classifier, arm):
    state = np.zeros((1, 3))
    own = CheckTransition(arm, arm_classifier, k=0, accuracy=None, rng=np.random.default_rng(0))
    assert own(state, state).shape == (1,)
    planner = BiasedRRTConnect(Disc(), RightIsUnreliable())
    with pytest.raises(ValueError, match=r"accuracy \(p_acc\) is not known: RightIsUnreliable"):
        planner.plan([-0.9, 0], [0.9, 0])


class UnknownAccuracy(RightIsUnreliable):
    validation_accuracy_ = float("nan")


@pytest.mark.parametrize(
    ("estimator", "parameters", "error", "message"),
    [
        (None, {"k": -1}, ValueError, "k must be a number between 0 and inf, got -1"),
        (None, {"k": np.nan}, ValueError, "k must be a number between 0 and inf, got nan"),
        (None, {"k": "big"}, ValueError, "k must be a number between 0 and inf, got 'big'"),
        (RightIsUnreliable(), {"accuracy": 1.2}, ValueError, "accuracy must be a number between 0"),
        (RightIsUnreliable(), {"accuracy": -0.1}, ValueError, "accuracy must be a number"),
        (RightIsUnreliable(), {"accuracy": "x"}, ValueError, "accuracy must be a number"),
        (UnknownAccuracy(), {"accuracy": None}, ValueError, r"\(p_acc\) is not known"),
        (object(), {}, ValueError, "estimator must have the method predict"),
        (LogisticRegression(), {}, NotFittedError, "not fitted"),
        (fitted(LogisticRegression(), [2, 1] * 5), {}, ValueError, r"got \[.*1.*, .*2.*\]"),
        (
            fitted(LogisticRegression(), ["good", "bad"] * 5),
            {},
            ValueError,
            "must have the classes",
        ),
        (
            fitted(LogisticRegression(), [0, 1] * 5, n_features=7),
            {},
            ValueError,
            "fitted on 7 features, and Disc gives 4; fit it on transitions of this system",
        ),
    ],
)
def test_bad_input_is_refused(estimator, parameters, error, message):
    planner = BiasedRRTConnect(Disc(), estimator, **{"accuracy": 0.9} | parameters)
    with pytest.raises(error, match=message):
        planner.plan([-0.9, 0.0], [0.9, 0.0])
