"""Scikit-learn's callbacks are told of a training, in versions that have them."""

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV

from reliability import MLP, TransitionReliabilityClassifier, VoxNet

callback = pytest.importorskip("sklearn.callback", reason="scikit-learn 1.9 has callbacks")
pytest.importorskip("torch", reason="needs the extra [torch]")


class Recorder:
    """Notes what it is told; asks to stop after some epochs."""

    def __init__(self, n_epochs=np.inf):
        self.n_epochs = n_epochs
        self.told = []
        self.answers = []

    def setup(self, estimator, context):
        self.told.append("set up")

    def teardown(self, estimator, context):
        self.told.append("torn down")

    def on_fit_task_begin(self, estimator, context):
        self.told.append(f"{context.task_name} begins")

    def on_fit_task_end(self, estimator, context, *, X, y, metadata, fitted_estimator):
        self.told.append(f"{context.task_name} ends")
        self.answers.append(fitted_estimator.predict_proba(X[:5]))
        assert len(X) == len(y) == len(metadata["sample_weight"])
        return self.told.count("epoch ends") >= self.n_epochs


@pytest.fixture(scope="module")
def data():
    X = np.random.default_rng(0).normal(size=(80, 3))
    return X, (X[:, 0] > 0).astype(int), np.ones(80)


def network(backend=None, **parameters):
    given = {"max_epochs": 3, "patience": False, "random_state": 0, **parameters}
    return TransitionReliabilityClassifier(backend or MLP((8,)), **given)


@pytest.mark.parametrize("backend", [MLP((8,)), VoxNet()])
def test_callbacks_are_told_of_every_epoch_and_change_nothing(backend, data):
    X, y, weight = data
    recorder = Recorder()
    told = network(backend).set_callbacks(recorder).fit(X, y, sample_weight=weight)
    epochs = ["epoch begins", "epoch ends"] * 3
    assert recorder.told == ["set up", "fit begins", *epochs, "fit ends", "torn down"]
    plain = network(backend).fit(X, y, sample_weight=weight)
    assert np.array_equal(told.decision_function(X), plain.decision_function(X))
    assert np.array_equal(recorder.answers[-1], told.predict_proba(X[:5]))
    # An epoch's answers are those of a training that ends there, before calibration.
    shorter = network(backend, max_epochs=2, validation_fraction=0.0)
    recorder = Recorder()
    shorter.set_callbacks(recorder).fit(X, y, sample_weight=weight)
    np.testing.assert_allclose(recorder.answers[1], shorter.predict_proba(X[:5]), atol=1e-6)


def test_a_callback_can_end_the_training(data):
    X, y, weight = data
    recorder = Recorder(n_epochs=2)
    classifier = network().set_callbacks(recorder).fit(X, y, sample_weight=weight)
    assert len(classifier.history_) == 2
    assert recorder.told[-1] == "torn down"


class Impatient(Recorder):
    """Presses Ctrl-C when the last epoch ends."""

    def on_fit_task_end(self, estimator, context):
        self.told.append(f"{context.task_name} ends")
        if context.task_name == "epoch" and self.told.count("epoch ends") == 3:
            raise KeyboardInterrupt


def test_control_c_in_the_last_epochs_callbacks_is_not_swallowed(data):
    X, y, weight = data
    impatient = Impatient()
    with pytest.raises(KeyboardInterrupt):
        network().set_callbacks(impatient).fit(X, y, sample_weight=weight)
    assert impatient.told[-1] == "torn down"


def test_callbacks_clean_up_after_a_failure(data):
    X, y, weight = data
    recorder = Recorder()
    diverging = network(learning_rate=1e30).set_callbacks(recorder)
    with pytest.raises(FloatingPointError):
        diverging.fit(1e3 * X, y, sample_weight=weight)
    assert recorder.told[-1] == "torn down"
    assert "fit ends" not in recorder.told


def test_scikit_learns_monitor_scores_every_epoch(data):
    X, y, _ = data
    monitor = callback.ScoringMonitor(scoring="accuracy")
    network().set_callbacks(monitor).fit(X, y)
    scores = monitor.get_logs().data_as_pandas
    assert len(scores) >= 3


def test_callbacks_go_along_into_a_search(data):
    X, y, weight = data
    recorder = Recorder()
    candidate = network().set_callbacks(recorder)
    search = GridSearchCV(candidate, {"max_epochs": [1, 2]}, cv=2)
    search.fit(X, y, sample_weight=weight)
    assert recorder.told.count("fit ends") == 5, "four splits and the best again"
    assert isinstance(clone(candidate), TransitionReliabilityClassifier)
