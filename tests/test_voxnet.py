"""The classifier on voxel grids: learning, checkpoints, bad rows, scikit-learn's conventions."""

import itertools

import numpy as np
import pytest
from sklearn.utils.estimator_checks import parametrize_with_checks

from reliability import TransitionReliabilityClassifier
from reliability.persistence import ModelFileError
from reliability.voxnet import VoxNet

QUICK = {"max_epochs": 6, "batch_size": 16, "learning_rate": 3e-3, "random_state": 0}


def voxnet(**parameters):
    return TransitionReliabilityClassifier("voxnet", **QUICK | parameters)


def packed(cells):
    return np.packbits(cells.reshape(len(cells), -1), axis=1)


def hits(n, side=16):
    """Packed grids in which a block and a line are near one another or not, and which."""
    rng = np.random.default_rng(0)
    cells = np.zeros((n, 3, side, side, side), dtype=np.uint8)
    y = rng.integers(0, 2, n)
    for grid, hit in zip(cells, y, strict=True):
        x = rng.integers(3, side - 3)
        grid[0, x - 2 : x + 2, 4:12] = 1
        line = x if hit else (x + side // 2) % side
        grid[1:, line, :, side // 2] = 1
    return packed(cells), y


@pytest.fixture(scope="module")
def data():
    return hits(240)


@pytest.fixture(scope="module")
def fitted(data):
    X, y = data
    return voxnet(max_epochs=12).fit(X, y)


def expected_failures(estimator):
    return {
        "check_sample_weight_equivalence_on_dense_data": (
            "sample_weight is not equivalent to removing/repeating samples."
        )
    }


@parametrize_with_checks(
    [voxnet(max_epochs=15, validation_fraction=0.2)], expected_failed_checks=expected_failures
)
@pytest.mark.filterwarnings("ignore:The training rows are all of one class")
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.SkipTestWarning")
def test_scikit_learns_own_checks(estimator, check):
    check(estimator)


def test_it_learns_whether_a_band_is_near_an_obstacle(data, fitted):
    X, y = data
    assert fitted.score(X, y) > 0.95
    assert fitted.validation_accuracy_ > 0.8
    assert fitted.n_features_in_ == 1536
    assert len(fitted.history_) == 12


class KilledError(Exception):
    pass


def killed_in_epoch(monkeypatch, epoch):
    """Have training killed in the middle of an epoch."""
    forward, calls = VoxNet.forward, itertools.count()

    def die(self, rows):
        if next(calls) >= epoch:
            raise KilledError
        return forward(self, rows)

    monkeypatch.setattr(VoxNet, "forward", die)


def assert_same_fit(one, other):
    assert one.history_ == other.history_
    assert one.validation_accuracy_ == other.validation_accuracy_
    for name, array in one._state.items():
        np.testing.assert_array_equal(array, other._state[name])


@pytest.mark.parametrize(
    "parameters", [{}, {"patience": 2, "max_epochs": 30}, {"augment": True, "rows_per_epoch": 50}]
)
def test_a_killed_training_goes_on_to_the_same_end(data, tmp_path, monkeypatch, parameters):
    X, y = data
    whole = voxnet(**parameters).fit(X, y)
    path = tmp_path / "training"
    kept = voxnet(**parameters, checkpoint=path)
    per_epoch = 14 if "rows_per_epoch" not in parameters else 5
    for n_batches in (per_epoch // 2, 2 * per_epoch + 1):
        with monkeypatch.context() as patch:
            killed_in_epoch(patch, n_batches)
            with pytest.raises(KilledError):
                kept.fit(X, y)
    assert path.exists()
    assert_same_fit(kept.fit(X, y), whole)
    assert_same_fit(kept.fit(X, y), whole)
    assert [file.name for file in tmp_path.iterdir()] == ["training"]


def test_a_training_may_be_made_longer(data, tmp_path):
    X, y = data
    path = tmp_path / "training"
    voxnet(max_epochs=2, checkpoint=path).fit(X, y)
    longer = voxnet(max_epochs=4, checkpoint=path).fit(X, y)
    assert_same_fit(longer, voxnet(max_epochs=4).fit(X, y))
    with pytest.raises(ModelFileError, match="holds 4 epochs, more than max_epochs = 2"):
        voxnet(max_epochs=2, checkpoint=path).fit(X, y)


def test_a_checkpoint_of_another_training_is_refused(data, tmp_path):
    X, y = data
    path = tmp_path / "training"
    voxnet(max_epochs=1, checkpoint=path).fit(X, y)
    for parameters, message in (
        ({"learning_rate": 1e-3}, "learning_rate = '0.003' where this fit has '0.001'"),
        ({"random_state": 1}, "random_state = .* where this fit has"),
    ):
        with pytest.raises(ModelFileError, match=message):
            voxnet(**{"max_epochs": 1, "checkpoint": path} | parameters).fit(X, y)
    with pytest.raises(ModelFileError, match=r"data = .* another path"):
        voxnet(max_epochs=1, checkpoint=path).fit(X[::-1], y)
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(ModelFileError, match="is truncated or no checkpoint"):
        voxnet(max_epochs=1, checkpoint=path).fit(X, y)
    with pytest.raises(ValueError, match="checkpoint needs a random_state"):
        voxnet(checkpoint=path, random_state=None).fit(X, y)


def test_the_mlp_has_checkpoints_too(tmp_path, rng):
    X = rng.normal(size=(100, 3))
    parameters = {"hidden_layer_sizes": (8,), "random_state": 0, "checkpoint": tmp_path / "mlp"}
    TransitionReliabilityClassifier(max_epochs=3, **parameters).fit(X, X[:, 0] > 0)
    resumed = TransitionReliabilityClassifier(max_epochs=6, **parameters).fit(X, X[:, 0] > 0)
    del parameters["checkpoint"]
    whole = TransitionReliabilityClassifier(max_epochs=6, **parameters).fit(X, X[:, 0] > 0)
    assert_same_fit(resumed, whole)
