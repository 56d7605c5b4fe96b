"""With ``warm_start``, a further training begins where the last one ended."""

import numpy as np
import pytest
from sklearn.base import clone

from reliability import (
    MLP,
    TransitionReliabilityClassifier,
    VoxNet,
    load_estimator,
    save_estimator,
)

pytest.importorskip("torch", reason="needs the extra [torch]")


@pytest.fixture(scope="module")
def data():
    """Features of very different units, as the arm's angles and a far-off coordinate have."""
    X = np.random.default_rng(0).normal(size=(600, 3)) * [1, 100, 1e-3] + [0, 5000, 2]
    return X, (X[:, 0] + (X[:, 1] - 5000) / 100 > 0).astype(int)


def network(**parameters):
    given = {"backend": MLP((16, 8)), "max_epochs": 6, "random_state": 0, **parameters}
    return TransitionReliabilityClassifier(**given)


def still(classifier):
    """Let a further training change next to nothing: its weights are those that it began with."""
    return classifier.set_params(warm_start=True, max_epochs=1, learning_rate=1e-12)


@pytest.mark.parametrize("backend", [MLP((16, 8)), VoxNet()])
def test_a_second_fit_starts_from_the_weights_of_the_first(backend, data):
    X, y = data if isinstance(backend, MLP) else (data[0][:60] - [0, 5000, 2], data[1][:60])
    classifier = network(backend=backend, patience=False).fit(X, y)
    first = classifier.decision_function(X)
    same = still(classifier).fit(X, y).decision_function(X)
    # Calibration on the held-out rows multiplies all by one number.
    factor = same[0] / first[0]
    np.testing.assert_allclose(same, factor * first, rtol=1e-3, atol=1e-3)
    anew = still(clone(classifier)).fit(X, y).decision_function(X)
    assert not np.allclose(anew, (anew[0] / first[0]) * first, rtol=0.1)


def test_going_on_learns_faster_than_beginning_anew(data):
    X, y = data
    classifier = network(max_epochs=20).fit(X, y)
    anew = classifier.history_[0]["train_loss"]
    classifier.set_params(warm_start=True, max_epochs=1).fit(X, y)
    assert len(classifier.history_) == 1
    assert classifier.history_[0]["train_loss"] < 0.7 * anew
    assert classifier.set_params(warm_start=False).fit(X, y).history_[0]["train_loss"] == anew


def test_the_first_fit_is_as_without(data):
    X, y = data
    plain, warm = network().fit(X, y), network(warm_start=True).fit(X, y)
    assert np.array_equal(plain.decision_function(X), warm.decision_function(X))


def test_going_on_is_repeatable_and_survives_a_file(data, tmp_path):
    X, y = data
    classifier = network(warm_start=True).fit(X[:300], y[:300])
    save_estimator(classifier, tmp_path / "first.skops")
    again = load_estimator(tmp_path / "first.skops")
    answers = [one.fit(X, y).decision_function(X) for one in (classifier, again)]
    assert np.array_equal(*answers)


def test_a_checkpoint_of_another_start_is_refused(data, tmp_path):
    X, y = data
    path = tmp_path / "training"
    classifier = network(warm_start=True, checkpoint=path).fit(X, y)
    with pytest.raises(ValueError, match="at the start"):
        classifier.fit(X, y)


def test_one_label_gives_no_weights_to_start_from(data):
    X, y = data
    constant = network(warm_start=True)
    with pytest.warns(UserWarning, match="all of one class"):
        constant.fit(X, np.zeros(len(X), int))
    with pytest.raises(ValueError, match=r"labels of the last fit, \[0\], got \[0, 1\]"):
        constant.fit(X, y)


@pytest.mark.parametrize(
    ("parameters", "X", "message"),
    [
        ({}, np.zeros((4, 2)), "X has 2 features"),
        ({"backend": MLP((8, 8))}, None, "warm_start needs the backend of the last fit"),
        ({"backend": VoxNet()}, None, "warm_start needs the backend of the last fit"),
        ({"warm_start": "yes"}, None, "warm_start must be True or False, got 'yes'"),
    ],
)
def test_what_does_not_go_on_is_refused(parameters, X, message, data):
    classifier = network(warm_start=True).fit(*data)
    X, y = (data[0], data[1]) if X is None else (X, np.array([0, 1, 0, 1]))
    with pytest.raises(ValueError, match=message):
        classifier.set_params(**parameters).fit(X, y)


def test_packed_grids_do_not_go_on_from_numbers():
    numbers = np.random.default_rng(0).normal(size=(40, 512))
    y = (numbers[:, 0] > 0).astype(int)
    classifier = network(backend=VoxNet(), warm_start=True, max_epochs=1).fit(numbers, y)
    with pytest.raises(ValueError, match="rows as in the last fit: numbers, got packed grids"):
        classifier.fit(np.zeros((40, 512), np.uint8), y)
