"""Checkpoints: a killed training goes on to the same end, and no other file is believed."""

import hashlib
import io
import pickle
from copy import copy

import numpy as np
import pytest
import torch
from own_modules import KilledError, Mortal, TwoLayers

from reliability import MLP, ModelFileError, TransitionReliabilityClassifier

N = 100
X = np.random.default_rng(0).normal(size=(N, 3))
Y = X[:, 0] > 0.3


def small(backend=TwoLayers, **parameters):
    quick = {"max_epochs": 4, "batch_size": 20, "random_state": 0}
    return TransitionReliabilityClassifier(backend, **quick | parameters)


def content(classifier):
    """Return all of a fitted classifier but for parameters in which a continuation may differ."""
    return pickle.dumps(copy(classifier).set_params(checkpoint=None, max_epochs=1))


@pytest.fixture
def path(tmp_path):
    return tmp_path / "training"


@pytest.mark.parametrize(
    "parameters",
    [
        {},
        {"patience": 2, "max_epochs": 40, "learning_rate": 0.1},
        {"rows_per_epoch": 50, "balanced_batches": True},
        {"learning_rate_decay": 0.5, "epochs_per_decay": 2},
        {"validation_fraction": 0.0},
    ],
    ids=str,
)
def test_a_killed_training_goes_on_to_the_same_end(path, monkeypatch, parameters):
    whole = small(Mortal, **parameters).fit(X, Y)
    kept = small(Mortal, **parameters, checkpoint=path)
    for n_batches in (1, 5, 4):
        monkeypatch.setattr(Mortal, "lives", n_batches)
        with pytest.raises(KilledError):
            kept.fit(X, Y)
    assert path.exists()
    monkeypatch.setattr(Mortal, "lives", np.inf)
    assert content(kept.fit(X, Y)) == content(whole)
    monkeypatch.setattr(Mortal, "lives", 0)
    assert content(kept.fit(X, Y)) == content(whole), "nothing is left to train"
    assert [file.name for file in path.parent.iterdir()] == ["training"]


def test_an_interrupted_training_goes_on_too(path, monkeypatch):
    monkeypatch.setattr(Mortal, "lives", 9)
    monkeypatch.setattr(Mortal, "error", KeyboardInterrupt)
    kept = small(Mortal, checkpoint=str(path))
    with pytest.raises(KeyboardInterrupt):
        kept.fit(X, Y)
    monkeypatch.setattr(Mortal, "lives", np.inf)
    assert content(kept.fit(X, Y)) == content(small(Mortal).fit(X, Y))


def test_a_training_may_be_made_longer(path):
    small(MLP((8,)), max_epochs=3, checkpoint=path).fit(X, Y)
    longer = small(MLP((8,)), max_epochs=6, checkpoint=path).fit(X, Y)
    assert content(longer) == content(small(MLP((8,)), max_epochs=6).fit(X, Y))
    assert [epoch["epoch"] for epoch in longer.history_] == [1, 2, 3, 4, 5, 6]
    with pytest.raises(ModelFileError, match="holds 6 epochs, more than max_epochs = 5"):
        small(MLP((8,)), max_epochs=5, checkpoint=path).fit(X, Y)


def test_the_progress_bar_of_a_continuation_starts_where_it_stopped(path, capsys):
    small(checkpoint=path, max_epochs=3).fit(X, Y)
    small(checkpoint=path, max_epochs=4, verbose=1).fit(X, Y)
    shown = capsys.readouterr().err
    assert "epoch 4/4" in shown
    assert "16/16" in shown, "batches of four epochs"


def test_the_same_numbers_of_other_types_are_the_same_training(path):
    small(MLP((8, 4)), learning_rate=1e-3, checkpoint=path).fit(X, Y)
    same = small(MLP([np.int64(8), 4]), learning_rate=np.float64(1e-3), checkpoint=str(path))
    same.set_params(batch_size=np.uint8(20), random_state=np.int64(0), verbose=0)
    assert len(same.fit(X, Y).history_) == 4


def test_a_checkpoint_of_another_training_is_refused_with_what_differs(path):
    small(MLP((8,)), checkpoint=path).fit(X, Y)
    before = path.read_bytes()
    weight = np.where(Y, 2.0, 1.0)
    for parameters, arguments, message in (
        ({"learning_rate": 1e-3}, (X, Y), "learning_rate = 0.002 where this fit has 0.001"),
        ({"backend": MLP((9,))}, (X, Y), r"hidden_layer_sizes = \(8,\) where this fit has \(9,\)"),
        ({"backend": TwoLayers}, (X, Y), "backend = 'MLP' where this fit has 'OwnModule'"),
        ({"random_state": 1}, (X, Y), "seed drawn from random_state = .* where this fit has"),
        ({"validation_fraction": 0.3}, (X, Y), "validation_fraction = 0.2 where this fit has 0.3"),
        ({"class_weight": "balanced"}, (X, Y), "digest of the weights = .* where"),
        ({}, (X, Y, None, weight), "digest of the weights = .* where"),
        ({}, (X, Y, np.arange(N) // 2), "digest of the held-out rows = .* where"),
        ({}, (X[::-1], Y), "digest of X = .* or another path"),
        ({}, (X, ~Y), "digest of y = .* or another path"),
    ):
        with pytest.raises(ModelFileError, match=message) as error:
            small(**{"backend": MLP((8,)), "checkpoint": path} | parameters).fit(*arguments)
        assert "is the checkpoint of another training" in str(error.value)
        assert str(path) in str(error.value)
    assert path.read_bytes() == before


def test_what_does_not_differ_is_not_named(path):
    small(MLP((8,)), checkpoint=path).fit(X, Y)
    with pytest.raises(ModelFileError) as error:
        small(MLP((8,)), checkpoint=path, learning_rate=1.0).fit(X, Y)
    assert str(error.value).count("where this fit has") == 1


def test_a_flipped_bit_is_noticed(path, rng):
    small(MLP((8,)), max_epochs=2, checkpoint=path).fit(X, Y)
    sound = path.read_bytes()
    for _ in range(60):
        damaged = bytearray(sound)
        damaged[rng.integers(len(sound))] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        with pytest.raises(
            ModelFileError, match=r"training is (truncated or damaged|no checkpoint)"
        ):
            small(MLP((8,)), max_epochs=2, checkpoint=path).fit(X, Y)
    path.write_bytes(sound)
    small(MLP((8,)), max_epochs=2, checkpoint=path).fit(X, Y)


@pytest.mark.parametrize("n_bytes", [0, 10, 50, 70, 1000, -1])
def test_a_truncated_file_is_noticed(path, n_bytes):
    small(MLP((8,)), max_epochs=1, checkpoint=path).fit(X, Y)
    path.write_bytes(path.read_bytes()[:n_bytes])
    with pytest.raises(ModelFileError, match="to train anew"):
        small(MLP((8,)), max_epochs=1, checkpoint=path).fit(X, Y)


@pytest.mark.parametrize(
    "entry",
    ["identity", "module", "optimizer", "decay", "stop", "history", "generator"],
)
@pytest.mark.parametrize("harm", ["missing", "of another kind"])
def test_a_state_that_no_training_has_is_refused(path, entry, harm):
    """The digest is right: the file is of another version or author."""
    small(MLP((8,)), max_epochs=1, checkpoint=path).fit(X, Y)
    first_line, _, rest = path.read_bytes().partition(b"\n")
    state = torch.load(io.BytesIO(rest[16:]), weights_only=True)
    del state[entry]
    if harm == "of another kind":
        state[entry] = "?"
    stream = io.BytesIO()
    torch.save(state, stream)
    digest = hashlib.blake2b(stream.getvalue(), digest_size=16).digest()
    path.write_bytes(first_line + b"\n" + digest + stream.getvalue())
    with pytest.raises(ModelFileError, match=r"Delete it to train anew|another training"):
        small(MLP((8,)), max_epochs=2, checkpoint=path).fit(X, Y)


def test_a_file_that_cannot_be_written_is_noticed_before_training(tmp_path, monkeypatch):
    monkeypatch.setattr(Mortal, "lives", 0)
    for place, reason in (
        (tmp_path / "absent" / "training", "No such file or directory"),
        (tmp_path, "it is a folder"),
    ):
        with pytest.raises(ValueError, match=f"checkpoint must be a file .*{reason}"):
            small(Mortal, checkpoint=place).fit(X, Y)
    with pytest.raises(ValueError, match="checkpoint must be the path of a file, got 5"):
        small(Mortal, checkpoint=5).fit(X, Y)
    with pytest.raises(ValueError, match="checkpoint needs a random_state"):
        small(Mortal, checkpoint=tmp_path / "training", random_state=None).fit(X, Y)
    assert list(tmp_path.iterdir()) == []
