"""What a training does with rows, weights, the held-out part and its hyperparameters."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from own_modules import Echo, Mortal, Scripted, TwoLayers, Visits

from reliability import MLP, TransitionReliabilityClassifier
from reliability.training_set import hold_out, thin

N = 120
NUMBERS = np.column_stack([np.arange(N), np.zeros(N)])
LABELS = np.arange(N) % 3 == 0


def small(backend=None, **parameters):
    quick = {"max_epochs": 15, "batch_size": 64, "patience": False, "random_state": 0}
    return TransitionReliabilityClassifier(backend or MLP((32, 16)), **quick | parameters)


def visits(groups=None, sample_weight=None, labels=LABELS, **parameters):
    """Train on numbered rows, and return how often each was trained on, and how many batches."""
    classifier = small(Visits, **parameters)
    classifier.fit(NUMBERS, labels, groups=groups, sample_weight=sample_weight)
    counts = classifier.decision_function(np.vstack([NUMBERS, [1000, 0]]))
    return counts[:-1].astype(int), int(counts[-1])


def cross_entropy(logits, labels, weight):
    loss = np.log1p(np.exp(-np.where(labels, logits, -logits)))
    return np.sum(weight * loss) / np.sum(weight)


# Which rows are trained on


def test_an_epoch_visits_each_training_row_once():
    counts, n_batches = visits(max_epochs=3, validation_fraction=0.25, batch_size=20)
    assert sorted(set(counts)) == [0, 3]
    assert np.count_nonzero(counts == 0) == 30
    assert n_batches == 3 * 5, "four of 20 and one of 10 rows"


def test_whole_groups_are_held_out():
    groups = np.repeat(np.arange(12), 10)
    counts, _ = visits(groups, max_epochs=2, validation_fraction=0.25)
    per_group = counts.reshape(12, 10)
    assert (per_group == per_group[:, :1]).all()
    assert np.count_nonzero(per_group[:, 0] == 0) == 3
    named, _ = visits([f"plan {group:02}" for group in groups], max_epochs=2)
    assert np.count_nonzero(named.reshape(12, 10)[:, 0] == 0) == 2, "0.2 of 12"


def test_another_seed_holds_out_other_rows():
    first, second = (visits(max_epochs=1, random_state=seed)[0] for seed in (0, 1))
    assert (first != second).any()
    assert first.sum() == second.sum()


def test_rows_of_weight_zero_are_not_trained_on():
    weight = np.where(np.arange(N) < 50, 0.0, 1.0)
    counts, _ = visits(sample_weight=weight, max_epochs=2, validation_fraction=0.0)
    assert not counts[:50].any()
    assert (counts[50:] == 2).all()


@pytest.mark.parametrize("rows_per_epoch", [1, 40, 120, 290, np.uint8(200)])
def test_an_epoch_may_be_any_number_of_rows(rows_per_epoch):
    counts, n_batches = visits(
        rows_per_epoch=rows_per_epoch, max_epochs=1, validation_fraction=0.0, batch_size=np.uint8(7)
    )
    assert counts.sum() == rows_per_epoch
    assert counts.max() - counts.min() <= 1, "no row comes again before all have come"
    assert n_batches == -(-int(rows_per_epoch) // 7)


def test_epochs_draw_different_rows():
    counts, _ = visits(rows_per_epoch=30, max_epochs=4, validation_fraction=0.0)
    assert np.count_nonzero(counts) > 70
    assert counts.max() > 1


def test_balanced_batches_visit_both_classes_alike():
    rare = np.arange(N) < 12
    plain, _ = visits(labels=rare, max_epochs=20, validation_fraction=0.0)
    balanced, _ = visits(labels=rare, max_epochs=20, validation_fraction=0.0, balanced_batches=True)
    assert plain[rare].sum() == 12 * 20
    assert balanced.sum() == N * 20
    assert abs(balanced[rare].mean() * 12 / balanced.sum() - 0.5) < 0.04
    assert len(set(balanced[rare])) > 1, "drawn with replacement"


def test_held_out_rows_do_not_influence_the_weights():
    X = np.random.default_rng(0).normal(size=(100, 2))
    y = (X[:, 0] > 0).astype(int)
    groups = np.repeat(np.arange(10), 10)
    reference = small(validation_fraction=0.5).fit(X, y, groups=groups)

    def direction(classifier):
        # How sure to be is learned from the held-out rows.
        logits = classifier.decision_function(X)
        return logits / np.linalg.norm(logits)

    changed = []
    for group in range(10):
        flipped = np.where(groups == group, 1 - y, y)
        again = small(validation_fraction=0.5).fit(X, flipped, groups=groups)
        changed.append(np.abs(direction(again) - direction(reference)).max() > 1e-6)
    assert sum(changed) == 5, "only the training half of the groups matters"


@given(
    st.integers(1, 60),
    st.floats(0, 1),
    st.lists(st.integers(0, 9), min_size=60, max_size=60) | st.none(),
    st.integers(0, 99),
)
@settings(derandomize=True, deadline=None)
def test_hold_out_splits_rows_in_two(n_rows, fraction, groups, seed):
    groups = None if groups is None else np.array(groups[:n_rows])
    training, held_out = hold_out(n_rows, groups, fraction, np.random.default_rng(seed))
    assert sorted([*training, *held_out]) == list(range(n_rows))
    assert len(training) > 0
    units = n_rows if groups is None else len(set(groups))
    n_held_out = len(held_out) if groups is None else len(set(groups[held_out]))
    assert n_held_out == min(round(fraction * units), units - 1)
    if groups is not None:
        assert not set(groups[training]) & set(groups[held_out])


@given(st.integers(0, 300), st.integers(1, 100) | st.none())
@settings(derandomize=True, deadline=None)
def test_thinning_takes_rows_at_equal_distances(n_rows, n):
    rows = np.arange(1000, 1000 + n_rows)
    kept = thin(rows, n)
    assert set(kept) <= set(rows)
    assert len(set(np.diff(kept))) <= 1
    if n is None:
        assert len(kept) == n_rows
    else:
        assert min(n, n_rows) / 2 <= len(kept) <= n


# Weights


def test_losses_and_accuracies_are_weighted(rng):
    X = rng.normal(size=(N, 2)).astype(np.float32)
    weight = rng.uniform(0, 5, N)
    weight[::4] = 0
    parameters = {"max_epochs": 1, "batch_size": 8, "validation_fraction": 0.3}
    classifier = small(Echo, **parameters).fit(X, LABELS, sample_weight=weight)
    training, held_out = hold_out(N, None, 0.3, np.random.default_rng(0))
    (epoch,) = classifier.history_
    for name, rows in (("train_loss", training), ("valid_loss", held_out)):
        expected = cross_entropy(X[rows, 0], LABELS[rows], weight[rows])
        assert epoch[name] == pytest.approx(expected, rel=1e-5)
    right = (X[held_out, 0] > 0) == LABELS[held_out]
    accuracy = np.average(right, weights=weight[held_out])
    assert classifier.validation_accuracy_ == pytest.approx(accuracy)
    assert epoch["valid_accuracy"] == pytest.approx(accuracy)
    assert accuracy != pytest.approx(right.mean(), abs=1e-3)


def test_class_weights_count_in_the_loss_and_not_in_the_accuracy(rng):
    X = rng.normal(size=(N, 2)).astype(np.float32)
    parameters = {"max_epochs": 1, "class_weight": {0: 1.0, 1: 7.0}, "validation_fraction": 0.3}
    classifier = small(Echo, **parameters).fit(X, LABELS.astype(int))
    training, held_out = hold_out(N, None, 0.3, np.random.default_rng(0))
    weight = np.where(LABELS, 7.0, 1.0)
    expected = cross_entropy(X[training, 0], LABELS[training], weight[training])
    assert classifier.history_[0]["train_loss"] == pytest.approx(expected, rel=1e-5)
    right = (X[held_out, 0] > 0) == LABELS[held_out]
    assert classifier.validation_accuracy_ == pytest.approx(right.mean())
    assert classifier.history_[0]["valid_accuracy"] == pytest.approx(right.mean())


def test_random_labels_of_weight_zero_do_not_lower_the_accuracy(rng):
    X = rng.normal(size=(4000, 2))
    weight = (rng.random(4000) < 0.5).astype(float)
    y = np.where(weight > 0, X[:, 0] > 0, rng.random(4000) < 0.5)
    classifier = small(Echo, max_epochs=1).fit(X, y, sample_weight=weight)
    assert classifier.validation_accuracy_ == 1.0
    assert classifier.history_[0]["valid_accuracy"] == 1.0
    unweighted = small(Echo, max_epochs=1).fit(X, y)
    assert unweighted.validation_accuracy_ == pytest.approx(0.75, abs=0.03)


def test_held_out_rows_of_weight_zero_tell_nothing():
    groups = np.arange(N)
    _, held_out = hold_out(N, groups, 0.2, np.random.default_rng(0))
    weight = np.ones(N)
    weight[held_out] = 0
    classifier = small(Echo, max_epochs=2, patience=1).fit(NUMBERS, LABELS, groups, weight)
    assert np.isnan(classifier.validation_accuracy_)
    assert classifier.history_[0].keys() == {"epoch", "train_loss"}


def test_nothing_held_out_means_an_unknown_accuracy():
    classifier = small(Echo, max_epochs=3, patience=1, validation_fraction=0.0)
    classifier.fit(NUMBERS, LABELS)
    assert np.isnan(classifier.validation_accuracy_)
    assert len(classifier.history_) == 3, "patience has nothing to go by"


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


# Stopping


@pytest.mark.parametrize(
    ("patience", "n_epochs", "best"),
    [(1, 3, 0.5), (2, 4, 0.5), (4, 6, 0.5), (5, 8, 0.9), (None, 8, 0.9), (np.False_, 8, 0.1)],
)
def test_early_stopping_keeps_the_weights_of_the_best_epoch(patience, n_epochs, best):
    X = np.where(LABELS, 1.0, -1.0)[:, None]  # A larger factor is a smaller loss.
    classifier = small(Scripted, max_epochs=8, batch_size=N, patience=patience).fit(X, LABELS)
    losses = [epoch["valid_loss"] for epoch in classifier.history_]
    assert losses == pytest.approx([np.log1p(np.exp(-f)) for f in Scripted.script[:n_epochs]])
    np.testing.assert_allclose(classifier.decision_function(X), best * X[:, 0], rtol=1e-6)


def test_as_good_as_before_is_no_improvement(monkeypatch):
    monkeypatch.setattr(Scripted, "script", (0.5,) * 8)
    classifier = small(Scripted, max_epochs=8, batch_size=N, patience=np.int64(2))
    classifier.fit(np.where(LABELS, 1.0, -1.0)[:, None], LABELS)
    assert len(classifier.history_) == 3


def test_a_slightly_smaller_loss_is_an_improvement(monkeypatch):
    monkeypatch.setattr(Scripted, "script", tuple(0.5 + 0.001 * i for i in range(8)))
    classifier = small(Scripted, max_epochs=8, batch_size=N, patience=1)
    classifier.fit(np.where(LABELS, 1.0, -1.0)[:, None], LABELS)
    assert len(classifier.history_) == 8


def test_early_stopping_looks_at_weighted_rows_only():
    held_out = hold_out(N, None, 0.2, np.random.default_rng(0))[1]
    X = np.where(LABELS, 1.0, -1.0)[:, None]
    weight = np.ones(N)
    weight[held_out[::2]] = 0
    X[held_out[::2]] *= -5  # Seen, these would turn the order of the epochs around.
    classifier = small(Scripted, max_epochs=8, batch_size=N, patience=2)
    classifier.fit(X, LABELS, sample_weight=weight)
    assert len(classifier.history_) == 4
    assert classifier.validation_accuracy_ == 1.0


def test_a_held_out_loss_is_that_of_as_many_rows_as_an_epoch_at_most(rng):
    X = rng.normal(size=(N, 1)).astype(np.float32)
    parameters = {"max_epochs": 1, "validation_fraction": 0.5, "rows_per_epoch": 25}
    classifier = small(Echo, **parameters).fit(X, LABELS)
    held_out = hold_out(N, None, 0.5, np.random.default_rng(0))[1]
    seen = held_out[::3]
    expected = cross_entropy(X[seen, 0], LABELS[seen], np.ones(len(seen)))
    assert classifier.history_[0]["valid_loss"] == pytest.approx(expected, rel=1e-5)
    right = (X[held_out, 0] > 0) == LABELS[held_out]
    assert classifier.validation_accuracy_ == pytest.approx(right.mean()), "of all of them"


def test_the_learning_rate_decays(disc_data):
    X, y, _ = disc_data
    frozen = small(max_epochs=4, learning_rate_decay=0.0).fit(X, y)
    one_epoch = small(max_epochs=1).fit(X, y)
    np.testing.assert_array_equal(frozen.decision_function(X), one_epoch.decision_function(X))
    slow = small(max_epochs=4, learning_rate_decay=0.0, epochs_per_decay=4).fit(X, y)
    constant = small(max_epochs=4, learning_rate_decay=1.0).fit(X, y)
    np.testing.assert_array_equal(slow.decision_function(X), constant.decision_function(X))


def test_a_learning_rate_of_zero_leaves_the_weights_as_they_were_drawn(rng):
    X = rng.normal(size=(N, 2))
    still = small(TwoLayers, learning_rate=0.0, max_epochs=1).fit(X, LABELS)
    longer = small(TwoLayers, learning_rate=0.0, max_epochs=5).fit(X, LABELS)
    moved = small(TwoLayers, max_epochs=1).fit(X, LABELS)
    np.testing.assert_array_equal(longer.decision_function(X), still.decision_function(X))
    assert (moved.decision_function(X) != still.decision_function(X)).all()


@pytest.mark.parametrize("batch", [1, 4, 6])
def test_an_interrupted_training_is_not_taken_for_a_finished_one(batch, monkeypatch, rng):
    monkeypatch.setattr(Mortal, "lives", batch - 1)
    monkeypatch.setattr(Mortal, "error", KeyboardInterrupt)
    classifier = small(Mortal, max_epochs=3, batch_size=48, patience=5)  # Two batches an epoch.
    with pytest.raises(KeyboardInterrupt):
        classifier.fit(rng.normal(size=(N, 2)), LABELS)


def test_diverging_training_stops_and_says_so():
    X = np.random.default_rng(0).normal(size=(200, 3)) * 1e30
    with pytest.raises(FloatingPointError, match="Training diverged in epoch 1: the loss is"):
        small(learning_rate=1e30).fit(X, X[:, 0] > 0)


def test_progress_on_request(disc_data, capsys):
    X, y, _ = disc_data
    small(max_epochs=2, verbose=1).fit(X, y)
    shown = capsys.readouterr().err
    assert "epoch 2/2" in shown
    assert "held-out accuracy" in shown
    small(max_epochs=2).fit(X, y)
    assert capsys.readouterr() == ("", "")


def test_the_progress_bar_ends_with_the_last_batch(capsys, rng):
    X = rng.normal(size=(N, 1))
    small(Echo, max_epochs=3, rows_per_epoch=40, batch_size=16, verbose=1).fit(X, LABELS)
    last = capsys.readouterr().err.rstrip().rpartition("\r")[2]
    assert "epoch 3/3" in last
    assert "9/9" in last, "batches of 16, 16 and 8 rows"
    for word in ("loss=", "accuracy=", "held-out accuracy="):
        assert word in last
