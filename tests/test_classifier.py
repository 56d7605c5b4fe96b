"""The classifier behaves as scikit-learn's do."""

import pickle

import numpy as np
import pytest
import torch
from sklearn.base import clone
from sklearn.calibration import CalibratedClassifierCV
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

from reliability import MLP, TransitionReliabilityClassifier

SMALL = {"backend": MLP((32, 16)), "max_epochs": 15, "batch_size": 64}


class TwoLayers(torch.nn.Module):
    """A network of a user's own."""

    def __init__(self, n_features):
        super().__init__()
        self.layers = torch.nn.Sequential(
            torch.nn.Linear(n_features, 16), torch.nn.Tanh(), torch.nn.Linear(16, 1)
        )

    def forward(self, rows):
        return self.layers(rows)


def small(**parameters):
    return TransitionReliabilityClassifier(**SMALL | {"random_state": 0} | parameters)


def expected_failures(estimator):
    return {
        "check_sample_weight_equivalence_on_dense_data": (
            "sample_weight is not equivalent to removing/repeating samples."
        )
    }


@parametrize_with_checks(
    [TransitionReliabilityClassifier()], expected_failed_checks=expected_failures
)
@pytest.mark.filterwarnings("ignore:The training rows are all of one class")
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.SkipTestWarning")
def test_scikit_learns_own_checks(estimator, check):
    check(estimator)


def test_it_learns(disc_data):
    X, y, plans = disc_data
    classifier = small(max_epochs=30).fit(X, y, groups=plans)
    assert classifier.score(X, y) > 0.9
    assert classifier.validation_accuracy_ > max(np.mean(y), 1 - np.mean(y)) + 0.02


def test_a_seed_reproduces_the_fit_and_leaves_global_generators_alone(disc_data):
    X, y, _ = disc_data
    torch.manual_seed(5)
    np.random.seed(5)  # noqa: NPY002
    first = small().fit(X, y)
    torch_draw, numpy_draw = torch.rand(1), np.random.rand()  # noqa: NPY002
    torch.manual_seed(99)
    second = small().fit(X, y)
    np.testing.assert_array_equal(first.decision_function(X), second.decision_function(X))
    assert first.validation_accuracy_ == second.validation_accuracy_
    assert first.history_ == second.history_
    torch.manual_seed(5)
    np.random.seed(5)  # noqa: NPY002
    assert torch_draw == torch.rand(1)
    assert numpy_draw == np.random.rand()  # noqa: NPY002
    other = small(random_state=1).fit(X, y)
    assert (first.decision_function(X) != other.decision_function(X)).any()


def test_groups_hold_out_whole_plans():
    X = np.random.default_rng(0).normal(size=(200, 2))
    groups = np.repeat(np.arange(20), 10)
    y = groups % 2
    X[:, 0] = groups  # A plan's number gives its label away, but only of plans seen in training.
    memorised = small(max_epochs=1).fit(X, y)
    held_out = small(max_epochs=1).fit(X, y, groups=groups)
    assert memorised.n_features_in_ == held_out.n_features_in_ == 2
    labelled = [f"plan {group}" for group in groups]
    same = small(max_epochs=1).fit(X, y, groups=labelled)
    assert 0 <= same.validation_accuracy_ <= 1
    assert (held_out.validation_accuracy_ * 40) % 1 == pytest.approx(0, abs=1e-9), "4 plans of 10"


def test_held_out_rows_do_not_influence_the_weights():
    X = np.random.default_rng(0).normal(size=(100, 2))
    y = (X[:, 0] > 0).astype(int)
    groups = np.repeat(np.arange(10), 10)
    reference = small(validation_fraction=0.5).fit(X, y, groups=groups)
    changed = []
    for group in range(10):
        flipped = np.where(groups == group, 1 - y, y)
        again = small(validation_fraction=0.5).fit(X, flipped, groups=groups)
        changed.append((again.decision_function(X) != reference.decision_function(X)).any())
    assert sum(changed) == 5, "only the training half of the groups matters"


def test_nothing_held_out_means_an_unknown_accuracy():
    X = np.random.default_rng(0).normal(size=(50, 2))
    classifier = small(validation_fraction=0.0).fit(X, X[:, 0] > 0)
    assert np.isnan(classifier.validation_accuracy_)


def imbalanced(rng):
    X = rng.normal(size=(2000, 2)).astype(np.float32)
    chance = 0.1 + 0.3 * (X[:, 0] > 0)
    return X, (rng.random(2000) < chance).astype(int)


@pytest.mark.parametrize(
    "parameters", [{"class_weight": "balanced"}, {"balanced_batches": True}], ids=str
)
def test_balancing_finds_more_of_the_rare_class(parameters, rng):
    X, y = imbalanced(rng)
    plain = small().fit(X, y).predict(X).mean()
    balanced = small(**parameters).fit(X, y).predict(X).mean()
    assert plain < 0.05
    assert 0.2 < balanced < 0.8


def test_sample_weight_tips_the_balance(rng):
    X, y = imbalanced(rng)
    weight = np.where(y == 1, 10.0, 1.0)
    assert small().fit(X, y, sample_weight=weight).predict(X).mean() > 0.8
    zeroed = np.where(y == 1, 0.0, 1.0)
    with pytest.warns(UserWarning, match="all of one class"):
        assert not small().fit(X, y, sample_weight=zeroed).predict(X).any()


def test_early_stopping_keeps_the_best_epoch(rng):
    X = rng.normal(size=(150, 5))
    y = rng.integers(0, 2, 150)  # Nothing to learn: the held-out loss soon rises.
    classifier = small(max_epochs=200, patience=5, learning_rate_decay=1.0).fit(X, y)
    losses = [epoch["valid_loss"] for epoch in classifier.history_]
    assert len(losses) < 200
    best = int(np.argmin(losses))
    assert len(losses) == best + 1 + 5
    accuracies = [epoch["valid_accuracy"] for epoch in classifier.history_]
    assert classifier.validation_accuracy_ == pytest.approx(accuracies[best])


def test_the_learning_rate_decays(disc_data):
    X, y, _ = disc_data
    frozen = small(max_epochs=4, learning_rate_decay=0.0).fit(X, y)
    one_epoch = small(max_epochs=1).fit(X, y)
    np.testing.assert_array_equal(frozen.decision_function(X), one_epoch.decision_function(X))
    slow = small(max_epochs=4, learning_rate_decay=0.0, epochs_per_decay=4).fit(X, y)
    constant = small(max_epochs=4, learning_rate_decay=1.0).fit(X, y)
    np.testing.assert_array_equal(slow.decision_function(X), constant.decision_function(X))


def test_probabilities_follow_the_decision(disc_data):
    X, y, _ = disc_data
    classifier = small().fit(X, y)
    decision = classifier.decision_function(X)
    probability = classifier.predict_proba(X)
    np.testing.assert_allclose(probability.sum(axis=1), 1)
    np.testing.assert_allclose(probability[:, 1], 1 / (1 + np.exp(-decision.astype(float))))
    np.testing.assert_array_equal(classifier.predict(X), decision > 0)


def test_the_fast_path_agrees_with_predict_on_every_sample(arm_classifier, arm_transitions, arm):
    X = arm_transitions.features(arm)
    assert len(X) > 4000, "enough rows for the tensor library"
    predicted = arm_classifier.predict(X)
    np.testing.assert_array_equal(arm_classifier.fast_decision_function(X) > 0, predicted)
    singly = [arm_classifier.fast_decision_function(X[i : i + 1])[0] > 0 for i in range(500)]
    np.testing.assert_array_equal(singly, predicted[:500])
    on_the_boundary = boundary_rows(arm_classifier, X)
    np.testing.assert_array_equal(
        arm_classifier.fast_decision_function(on_the_boundary) > 0,
        arm_classifier.predict(on_the_boundary),
    )


def boundary_rows(classifier, X):
    """Bisect between rows of either class until rounding decides."""
    predicted = classifier.predict(X) == 1
    n = 3000
    one, other = np.resize(X[predicted], (n, X.shape[1])), np.resize(X[~predicted], (n, X.shape[1]))
    for _ in range(40):
        middle = (one + other) / 2
        reliable = (classifier.predict(middle) == 1)[:, None]
        one, other = np.where(reliable, middle, one), np.where(reliable, other, middle)
    return np.concatenate([one, other])


def test_it_works_inside_scikit_learns_tools(disc_data):
    X, y, plans = disc_data
    pipeline = make_pipeline(StandardScaler(), small(max_epochs=8))
    folds = GroupKFold(3)
    scores = cross_val_score(pipeline, X, y, cv=folds, groups=plans)
    assert scores.mean() > 0.7
    grid = GridSearchCV(
        pipeline, {"transitionreliabilityclassifier__max_epochs": [1, 8]}, cv=folds
    ).fit(X, y, groups=plans)
    assert grid.best_score_ >= scores.mean() - 0.05
    for method in ("sigmoid", "isotonic", "temperature"):
        calibrated = CalibratedClassifierCV(small(max_epochs=8), method=method, cv=3).fit(X, y)
        assert calibrated.score(X, y) > 0.7


def test_string_labels_are_kept(disc_data):
    X, y, _ = disc_data
    names = np.where(y == 1, "reliable", "unreliable")
    classifier = small().fit(X, names)
    assert classifier.classes_.tolist() == ["reliable", "unreliable"]
    assert np.mean(classifier.predict(X) == names) > 0.8


def test_one_class_is_predicted_ever_after():
    X = np.zeros((20, 2))
    with pytest.warns(UserWarning, match="all of one class"):
        classifier = small().fit(X, np.ones(20, dtype=int))
    assert classifier.classes_.tolist() == [1]
    assert classifier.predict(X).tolist() == [1] * 20
    assert classifier.predict_proba(X).shape == (20, 1)
    assert classifier.validation_accuracy_ == 1.0


def test_a_module_of_the_users_own_is_a_backend(disc_data):
    X, y, _ = disc_data
    classifier = small(backend=TwoLayers, max_epochs=30, learning_rate=1e-2).fit(X, y)
    assert classifier.score(X, y) > 0.8
    again = pickle.loads(pickle.dumps(classifier))
    np.testing.assert_array_equal(again.predict_proba(X), classifier.predict_proba(X))


def test_clones_are_unfitted_copies():
    classifier = small(patience=3)
    again = clone(classifier)
    assert repr(again) == repr(classifier)
    with pytest.raises(NotFittedError):
        again.predict([[0.0]])


def test_progress_on_request(disc_data, capsys):
    X, y, _ = disc_data
    small(max_epochs=2, verbose=1).fit(X, y)
    shown = capsys.readouterr().err
    assert "2/2" in shown
    assert "held-out accuracy" in shown
    small(max_epochs=2).fit(X, y)
    assert capsys.readouterr() == ("", "")


def test_diverging_training_stops_and_says_so():
    X = np.random.default_rng(0).normal(size=(200, 3)) * 1e30
    with pytest.raises(FloatingPointError, match="Training diverged in epoch 1"):
        small(learning_rate=1e30).fit(X, X[:, 0] > 0)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"backend": "forest"}, 'backend must be "mlp", "voxnet", an object such as MLP'),
        ({"backend": MLP((8, 0))}, "hidden_layer_sizes must be a positive integer, got 0"),
        ({"backend": MLP(8)}, "hidden_layer_sizes must be a tuple of positive integers"),
        ({"max_epochs": 0}, "max_epochs must be a positive integer, got 0"),
        ({"batch_size": 2.5}, "batch_size must be a positive integer, got 2.5"),
        ({"epochs_per_decay": -1}, "epochs_per_decay must be a positive integer"),
        ({"patience": 0}, "patience must be a positive integer, got 0"),
        ({"learning_rate": -1.0}, "learning_rate must be a number between 0 and 1.79"),
        ({"learning_rate_decay": 1.5}, "learning_rate_decay must be a number between 0 and 1"),
        ({"validation_fraction": 1.2}, "validation_fraction must be a number between 0 and 1"),
        ({"random_state": "seed"}, "random_state must be None, an integer"),
    ],
)
def test_bad_parameters_are_refused_at_fit(parameters, message):
    classifier = small(**parameters)
    with pytest.raises(ValueError, match=message):
        classifier.fit(np.zeros((10, 2)), np.arange(10) % 2)


@pytest.mark.parametrize(
    ("y", "arguments", "message"),
    [
        (np.arange(10) % 3, {}, "Only binary classification is supported"),
        (np.arange(10) % 2, {"sample_weight": -np.ones(10)}, "sample_weight must hold 10 finite"),
        (np.arange(10) % 2, {"sample_weight": np.ones(3)}, "sample_weight must hold 10 finite"),
        (np.arange(10) % 2, {"sample_weight": np.zeros(10)}, "must be positive for some"),
        (np.arange(10) % 2, {"groups": np.arange(3)}, "inconsistent numbers of samples"),
    ],
)
def test_bad_data_are_refused_at_fit(y, arguments, message):
    with pytest.raises(ValueError, match=message):
        small().fit(np.zeros((10, 2)), y, **arguments)
