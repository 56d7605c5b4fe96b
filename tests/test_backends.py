"""Backends: objects with parameters and defaults of their own, and the short forms for them."""

import pickle

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra [torch]")

from own_modules import TwoLayers
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV, RandomizedSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from test_processes import run

from reliability import MLP, TransitionReliabilityClassifier, VoxNet


@pytest.fixture
def data(rng):
    X = rng.normal(size=(200, 3))
    return X, (X[:, 0] > 0).astype(int)


def small(backend, **parameters):
    return TransitionReliabilityClassifier(backend, max_epochs=2, random_state=0, **parameters)


def test_short_forms_mean_the_objects(data):
    X, y = data
    for short, backend in (("mlp", MLP()), ("voxnet", VoxNet())):
        expected = small(backend).fit(X, y)
        fitted = small(short).fit(X, y)
        np.testing.assert_array_equal(fitted.decision_function(X), expected.decision_function(X))
        assert fitted.backend == short, "the constructor only stores"


@pytest.mark.parametrize(
    ("backend", "other", "defaults"),
    [
        (
            MLP((8,)),
            {"learning_rate": 5e-4, "validation_fraction": 0.1, "balanced_batches": True},
            {
                "batch_size": 256,
                "learning_rate": 2e-3,
                "learning_rate_decay": 0.87,
                "epochs_per_decay": 1,
                "validation_fraction": 0.2,
                "balanced_batches": False,
                "patience": 5,
            },
        ),
        (
            VoxNet(),
            {"batch_size": 256, "learning_rate": 2e-3, "balanced_batches": False},
            {
                "batch_size": 32,
                "learning_rate": 5e-4,
                "learning_rate_decay": 0.8,
                "epochs_per_decay": 4,
                "validation_fraction": 0.1,
                "balanced_batches": True,
                "patience": 10,
            },
        ),
    ],
    ids=["mlp", "voxnet"],
)
def test_each_backend_has_defaults_of_its_own(backend, other, defaults, data):
    X, y = data
    implicit = small(backend).fit(X, y).decision_function(X)
    explicit = small(backend, **defaults).fit(X, y).decision_function(X)
    np.testing.assert_array_equal(implicit, explicit)
    for name, value in other.items():
        changed = small(backend, **{name: value}).fit(X, y).decision_function(X)
        assert (changed != implicit).any(), name


def test_backends_train_for_the_epochs_of_the_paper(data):
    X, y = data
    whole = {"patience": False, "random_state": 0}
    mlp = TransitionReliabilityClassifier(MLP((2,)), **whole).fit(X, y)
    assert len(mlp.history_) == 25
    assert VoxNet.defaults.max_epochs == 100
    own = TransitionReliabilityClassifier(TwoLayers, **whole).fit(X, y)
    assert len(own.history_) == 25, "as mlp"


def test_parameters_are_reached_through_the_classifier():
    classifier = small(VoxNet(pooling=2))
    assert classifier.get_params()["backend__pooling"] == 2
    classifier.set_params(backend__pooling=4, backend__augment=True)
    assert repr(classifier.backend) == "VoxNet(augment=True, pooling=4)"
    copied = clone(classifier)
    assert copied.backend is not classifier.backend
    assert copied.backend.get_params() == classifier.backend.get_params()
    assert "VoxNet(" in repr(classifier)


def test_searches_reach_the_backend_in_a_pipeline(data):
    X, y = data
    name = "transitionreliabilityclassifier"
    y = (np.abs(X[:, 0]) < 0.7).astype(int)  # One unit can't tell what lies on both sides.
    pipeline = make_pipeline(
        StandardScaler(), small(MLP(), learning_rate=0.02).set_params(max_epochs=20)
    )
    sizes = {f"{name}__backend__hidden_layer_sizes": [(1,), (32,)]}
    search = GridSearchCV(pipeline, sizes, cv=2).fit(X, y)
    best = search.best_estimator_[-1]
    assert best.backend.hidden_layer_sizes == search.best_params_[next(iter(sizes))] == (32,)
    assert search.best_score_ > 0.8


def test_random_searches_may_draw_numbers_of_numpy(data):
    X, y = data
    spread = {"batch_size": np.arange(20, 60), "learning_rate": np.logspace(-3, -2, 20)}
    search = RandomizedSearchCV(small(MLP((8,))), spread, n_iter=3, cv=2, random_state=0)
    assert search.fit(X, y).best_score_ > 0.3
    assert isinstance(search.best_params_["batch_size"], np.integer)


def test_a_module_of_the_users_own_is_a_backend(data):
    X, y = data
    classifier = TransitionReliabilityClassifier(TwoLayers, learning_rate=1e-2, random_state=0)
    assert classifier.fit(X, y).score(X, y) > 0.85
    again = pickle.loads(pickle.dumps(classifier))
    np.testing.assert_array_equal(again.predict_proba(X), classifier.predict_proba(X))
    np.testing.assert_array_equal(
        classifier.fast_decision_function(X), classifier.decision_function(X)
    )
    assert classifier.prefers_batches


def test_training_leaves_the_users_backend_alone(data):
    X, y = data
    backend = MLP((8,))
    classifier = small(backend).fit(X, y)
    before = classifier.decision_function(np.tile(X, (20, 1)))
    backend.set_params(hidden_layer_sizes=(4, 4))
    again = pickle.loads(pickle.dumps(classifier))
    for fitted in (classifier, again):
        np.testing.assert_array_equal(fitted.decision_function(np.tile(X, (20, 1))), before)


def test_small_and_large_batches_agree(data):
    X, y = data
    classifier = small(MLP((32, 16))).fit(X, y)
    many = np.tile(X, (20, 1))
    singly = np.concatenate([classifier.fast_decision_function(row[None]) for row in X])
    np.testing.assert_array_equal(classifier.fast_decision_function(X), singly)
    np.testing.assert_allclose(classifier.decision_function(many)[:200], singly, atol=1e-4)
    np.testing.assert_array_equal(classifier.predict(many) > 0, np.tile(singly > 0, 20))


@pytest.mark.parametrize(
    ("backend", "message"),
    [
        ("forest", 'backend must be "mlp", "voxnet", an object such as MLP'),
        (MLP, "backend must be .* got <class 'reliability.backends.MLP'>"),
        (None, "backend must be .* got None"),
        (MLP((8, 0)), "Each of hidden_layer_sizes must be a positive integer, got 0"),
        (MLP(8), "hidden_layer_sizes must be a tuple of positive integers, got 8"),
        (VoxNet(pooling=3), "pooling must be 1, 2 or 4, got 3"),
        (VoxNet(pooling=True), "pooling must be 1, 2 or 4, got True"),
        (VoxNet(mixed_precision="no"), "mixed_precision must be True or False, got 'no'"),
        (VoxNet(augment=1), "augment must be True or False, got 1"),
    ],
)
def test_bad_backends_are_refused_at_fit(backend, message, data):
    classifier = small(backend)
    with pytest.raises(ValueError, match=message):
        classifier.fit(*data)


@pytest.mark.parametrize("device", ["gpu", 0, None, "cuda:99"])
def test_a_device_that_is_not_here_is_refused_at_fit(device, data):
    with pytest.raises(ValueError, match="device must be a torch device of this machine"):
        small(MLP((8,)), device=device).fit(*data)


def test_a_model_of_a_device_that_is_not_here_predicts_on_the_cpu(data):
    X, y = data
    many = np.tile(X, (20, 1))
    for backend in (MLP((8,)), TwoLayers):
        classifier = small(backend).fit(X, y)
        expected = classifier.decision_function(many)
        classifier.set_params(device="cuda:99")
        np.testing.assert_array_equal(classifier.decision_function(many), expected)


def test_the_number_of_threads_is_left_as_it_was(data):
    X, y = data
    before = torch.get_num_threads()
    small(TwoLayers).fit(X, y).predict(X)
    assert torch.get_num_threads() == before


def test_making_classifiers_imports_no_torch():
    process = run(
        """
        import sys
        from sklearn.base import clone
        from reliability import MLP, TransitionReliabilityClassifier, VoxNet
        for backend in ("mlp", "voxnet", MLP(), VoxNet(pooling=2)):
            clone(TransitionReliabilityClassifier(backend)).get_params()
        print("torch" in sys.modules)
        """
    )
    assert process.stdout == "False\n"
