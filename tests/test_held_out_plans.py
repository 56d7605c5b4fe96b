"""What the plans that fit holds out decide: when to stop, which weights to keep, how sure to be."""

import numpy as np
import pytest
from scipy.special import expit

from reliability import MLP, TransitionReliabilityClassifier
from reliability.temperature import temperature_factor
from reliability.training_set import hold_out

N_PLANS, LENGTH = 100, 8
PLANS = np.repeat(np.arange(N_PLANS), LENGTH)


def eager(**parameters):
    """Return a network that soon knows its training rows by heart."""
    eager = {"learning_rate": 0.02, "random_state": 0}
    return TransitionReliabilityClassifier(MLP((64, 32)), **eager | parameters)


@pytest.fixture(scope="module")
def noisy():
    """Plans of many features and with a quarter of wrong labels, which a network soon knows."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(len(PLANS), 12))
    y = np.where(rng.random(len(PLANS)) < 0.25, X[:, 0] < 0, X[:, 0] > 0)
    return X, y.astype(int)


@pytest.fixture(scope="module")
def fitted(noisy):
    return eager().fit(*noisy, groups=PLANS)


def log_loss(logits, y):
    return np.mean(np.logaddexp(0, -np.where(y, logits, -logits).astype(float)))


def held_out_rows(groups, fraction=0.2):
    return hold_out(len(PLANS), groups, fraction, np.random.default_rng(0))[1]


def test_by_default_training_stops_where_held_out_plans_say_so(noisy, fitted):
    X, y = noisy
    losses = [epoch["calibrated_valid_loss"] for epoch in fitted.history_]
    best = int(np.argmin(losses))
    assert len(losses) == best + 1 + 5 < 25
    held_out = held_out_rows(PLANS)
    assert len(np.unique(PLANS[held_out])) == N_PLANS / 5
    assert len(held_out) == N_PLANS / 5 * LENGTH, "whole plans"
    kept = log_loss(fitted.decision_function(X[held_out]), y[held_out])
    assert kept == pytest.approx(losses[best], abs=1e-4)
    assert losses[-1] > kept + 1e-3


def test_the_last_weights_are_kept_on_request(noisy, fitted):
    X, y = noisy
    whole = eager(patience=False)
    whole.fit(X, y, groups=PLANS)
    assert len(whole.history_) == 25
    held_out = held_out_rows(PLANS)
    assert log_loss(whole.decision_function(X[held_out]), y[held_out]) > log_loss(
        fitted.decision_function(X[held_out]), y[held_out]
    )
    assert whole.score(X, y) > fitted.score(X, y) + 0.05, "it knows its own plans by heart"


# Features of any unit


@pytest.mark.parametrize("n_rows", [1, 5000])
def test_units_and_offsets_of_features_change_nothing(noisy, n_rows):
    X, y = noisy
    unit, offset = np.logspace(-5, 5, 12), np.linspace(-30, 30, 12)
    rows = np.resize(X, (n_rows, 12))
    moved = (rows + offset) * unit
    calm = {"learning_rate": 2e-3, "max_epochs": 5}
    expected = eager(**calm).fit(X, y, groups=PLANS).decision_function(rows)
    other = eager(**calm).fit((X + offset) * unit, y, groups=PLANS)
    np.testing.assert_allclose(other.decision_function(moved), expected, atol=2e-3)
    np.testing.assert_array_equal(other.fast_decision_function(moved) > 0, other.predict(moved))


def test_quick_answers_agree_near_zero_where_units_are_tiny(noisy):
    X, y = noisy
    X = 1 + X * 1e-4
    one = eager().fit(X, y, groups=PLANS)
    low, high = (np.resize(X[one.predict(X) == label], (4000, 12)) for label in (0, 1))
    for _ in range(30):
        middle = (low + high) / 2
        up = one.predict(middle)[:, None] == 1
        low, high = np.where(up, low, middle), np.where(up, middle, high)
    rows = np.concatenate([low, high])
    np.testing.assert_array_equal(one.fast_decision_function(rows) > 0, one.predict(rows))


def test_few_rows_are_gone_through_several_times():
    X = np.random.default_rng(0).normal(size=(40, 2))
    y = (X[:, 0] > 0).astype(int)
    few = TransitionReliabilityClassifier(MLP((32, 16)), random_state=0).fit(X, y)
    assert few.score(X, y) > 0.9
    assert len(few.history_) <= 25


def test_a_constant_feature_does_no_harm(noisy):
    X, y = noisy
    X = np.column_stack([X, np.full(len(X), 7.0)])
    one = eager().fit(X, y, groups=PLANS)
    assert np.isfinite(one.decision_function(X)).all()
    assert one.score(X, y) > 0.6


# How sure to be


def test_the_factor_is_that_of_the_smallest_loss(rng):
    logits = rng.normal(scale=2, size=20000)
    positive = rng.random(20000) < expit(0.4 * logits)
    weight = np.ones(20000)
    assert temperature_factor(logits, positive, weight) == pytest.approx(0.4, abs=0.02)
    assert temperature_factor(0.1 * logits, positive, weight) == 1, "never surer than trained"
    assert temperature_factor(logits[:0], positive[:0], weight[:0]) == 1
    assert temperature_factor(logits, positive, np.zeros(20000)) == 1
    assert temperature_factor(logits, rng.random(20000) < 0.5, weight) == pytest.approx(
        0.05, abs=0.02
    )
    # Rows of weight zero tell nothing.
    weight[10000:] = 0
    positive[10000:] = logits[10000:] < 0
    assert temperature_factor(logits, positive, weight) == pytest.approx(0.4, abs=0.02)


def test_probabilities_of_an_overfitted_network_are_softened(noisy):
    X, y = noisy
    held_out = held_out_rows(PLANS)
    one = eager(patience=False).fit(X, y, groups=PLANS)
    trained = one.history_[-1]["valid_loss"]
    kept = log_loss(one.decision_function(X[held_out]), y[held_out])
    assert kept < 0.8 * trained
    accuracy = np.mean(one.predict(X[held_out]) == y[held_out])
    assert one.validation_accuracy_ == accuracy == one.history_[-1]["valid_accuracy"]


def test_the_calibration_of_the_held_out_rows_is_told(noisy, fitted):
    X, y = noisy
    held_out = held_out_rows(PLANS)
    probability = fitted.predict_proba(X[held_out])[:, 1]
    bins = np.minimum((probability * 10).astype(int), 9)
    gaps = [
        np.abs(np.sum((probability - y[held_out])[bins == i])) / len(held_out) for i in range(10)
    ]
    assert fitted.validation_calibration_error_ == pytest.approx(sum(gaps), abs=1e-6)
    nothing = TransitionReliabilityClassifier(MLP((2,)), max_epochs=1, validation_fraction=0)
    assert np.isnan(nothing.fit(X, y).validation_calibration_error_)
