"""The classifier behaves as scikit-learn's do."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra [torch]")

from sklearn.base import clone
from sklearn.calibration import CalibratedClassifierCV
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

from reliability import MLP, TransitionReliabilityClassifier

SMALL = {"backend": MLP((32, 16)), "max_epochs": 15, "batch_size": 64}


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


def test_clones_are_unfitted_copies():
    classifier = small(patience=3)
    again = clone(classifier)
    assert repr(again) == repr(classifier)
    with pytest.raises(NotFittedError):
        again.predict([[0.0]])


def test_one_class_among_the_training_rows_is_predicted_for_every_row():
    X = np.zeros((40, 2))
    y = np.where(np.arange(40) < 4, "bad", "good")
    for wanted, other in (("good", "bad"), ("bad", "good")):
        with pytest.warns(UserWarning, match="all of one class, which will be predicted"):
            classifier = small().fit(X, y, sample_weight=(y == wanted).astype(float))
        assert classifier.classes_.tolist() == ["bad", "good"]
        assert set(classifier.predict(X)) == {wanted}
        probability = dict(zip(classifier.classes_, classifier.predict_proba(X)[0], strict=True))
        assert probability[wanted] == pytest.approx(1, abs=1e-9)
        assert probability[other] == pytest.approx(0, abs=1e-9)
        assert (classifier.fast_decision_function(X) > 0).all() == (wanted == "good")
        assert classifier.history_ == []
        assert not classifier.prefers_batches


def test_a_failed_fit_is_no_fit(rng):
    X = rng.normal(size=(60, 2)) * 1e30
    classifier = small(learning_rate=1e30)
    with pytest.raises(FloatingPointError):
        classifier.fit(X, X[:, 0] > 0)
    with pytest.raises(NotFittedError):
        classifier.predict(X)


def test_answers_follow_the_order_of_the_classes(rng):
    X = rng.normal(size=(300, 2))
    reliable = X[:, 0] > 0
    ours = small().fit(X, reliable.astype(int))
    swapped = small().fit(X, np.where(reliable, -7, 5))
    assert swapped.classes_.tolist() == [-7, 5]
    assert np.mean(swapped.predict(X) == np.where(reliable, -7, 5)) > 0.9
    assert np.mean((swapped.decision_function(X) < 0) == reliable) > 0.9
    assert np.mean((ours.predict_proba(X)[:, 1] > 0.5) == reliable) > 0.9
    assert np.mean((swapped.predict_proba(X)[:, 0] > 0.5) == reliable) > 0.9


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"max_epochs": 0}, "max_epochs must be a positive integer, got 0"),
        ({"batch_size": 2.5}, "batch_size must be a positive integer, got 2.5"),
        ({"epochs_per_decay": -1}, "epochs_per_decay must be a positive integer"),
        ({"patience": 0}, "patience must be a positive integer, got 0"),
        ({"learning_rate": -1.0}, "learning_rate must be a number between 0 and inf"),
        ({"learning_rate": np.inf}, "learning_rate must be finite, got inf"),
        ({"learning_rate": np.nan}, "learning_rate must be a number between 0 and inf"),
        ({"balanced_batches": "yes"}, "balanced_batches must be True or False, got 'yes'"),
        ({"rows_per_epoch": 0}, "rows_per_epoch must be a positive integer, got 0"),
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
        (np.arange(10) % 2, {"groups": np.arange(3)}, "groups must hold 10 plan ids"),
    ],
)
def test_bad_data_are_refused_at_fit(y, arguments, message):
    with pytest.raises(ValueError, match=message):
        small().fit(np.zeros((10, 2)), y, **arguments)
