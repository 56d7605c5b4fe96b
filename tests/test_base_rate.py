"""Warnings of labels and accuracies that say nothing, where one works with them."""

import warnings

import numpy as np
import pytest
from labelled_tables import executed_steps, pushed_box, table
from toy_systems import Disc

from planners import BiasedRRTConnect
from reliability import (
    MLP,
    RELIABLE,
    UNRELIABLE,
    BaseRateWarning,
    Summary,
    TransitionReliabilityClassifier,
    collect_transitions,
)
from reliability.base_rate import beats_base_rate


def fit(data, max_epochs=6, **parameters):
    small = MLP(hidden_layer_sizes=(32,))
    network = TransitionReliabilityClassifier(
        small, max_epochs=max_epochs, learning_rate=0.02, random_state=0, **parameters
    )
    return network.fit(data.reduced, data.y, groups=data.plan)


def test_fit_warns_of_an_accuracy_that_is_the_base_rate(rng):
    with pytest.warns(BaseRateWarning, match="no better than.*reliability.diagnose") as caught:
        network = fit(pushed_box(rng, n_plans=600))
    message = str(caught[0].message)
    assert f"The validation accuracy, {network.validation_accuracy_:.3f}," in message
    assert "0.93" in message.split("every row, ")[1]
    assert caught[0].filename == __file__, "where fit was called"


def test_fit_says_nothing_where_something_was_learned(rng):
    assert fit(executed_steps(rng, n_plans=300)).validation_accuracy_ > 0.85


def test_fit_says_nothing_of_weighted_classes_that_are_told_apart(rng):
    data = executed_steps(rng, n_plans=300, noise=0.7, bias=1.9)
    network = fit(data, max_epochs=12, class_weight="balanced")
    assert network.validation_accuracy_ < 1 - data.y.mean()


def test_fit_says_nothing_where_too_little_is_held_out(rng):
    data = pushed_box(rng, n_plans=260)
    fit(data[data.plan < 240])
    fit(data, validation_fraction=0.0)
    with pytest.warns(BaseRateWarning):
        fit(data)


def test_fit_says_nothing_where_plans_are_not_told_apart(rng):
    data = pushed_box(rng, n_plans=260)
    network = TransitionReliabilityClassifier(max_epochs=1, random_state=0)
    network.fit(data.reduced, data.y)


def test_rows_of_no_weight_count_in_no_accuracy(rng):
    """Half of the rows have random labels, and weigh nothing."""
    data = executed_steps(rng, n_plans=300)
    noise = rng.integers(0, 2, len(data))
    weight = np.arange(len(data)) % 2
    y = np.where(weight == 1, data.y, noise)
    network = TransitionReliabilityClassifier(max_epochs=8, random_state=0)
    network.fit(data.reduced, y, groups=data.plan, sample_weight=weight)
    assert network.validation_accuracy_ > 0.9


def test_better_than_the_base_rate_is_told_from_luck(rng):
    label = np.tile([1, 1, 1, 0], 200)
    groups = np.arange(800) // 8
    majority = label == 1
    assert not beats_base_rate(label, majority, groups)
    assert beats_base_rate(label, np.ones(800, dtype=bool), groups)
    assert not beats_base_rate(label, ~majority, groups)
    worse = majority & (rng.random(800) < 0.9)
    assert not beats_base_rate(label, worse, groups)
    better = majority | (rng.random(800) < 0.3)
    assert beats_base_rate(label, better, groups)
    np.testing.assert_array_equal(
        beats_base_rate(1 - label, better, groups.astype(str)), True, "whichever label is rarer"
    )


def test_plans_not_rows_are_what_luck_is_reckoned_by(rng):
    """Whole plans are answered by the toss of a coin: there is no skill, however long they are."""
    wrongly = 0
    for _ in range(200):
        label = rng.integers(0, 2, 40)
        right = rng.random(40) < 0.5
        long = [np.repeat(array, 50) for array in (label, right, np.arange(40))]
        wrongly += beats_base_rate(*long)
    assert wrongly <= 16, "one in twenty, with some room"


def test_weights_count(rng):
    label = np.tile([1, 0], 100)
    right = np.tile([True, False], 100)
    plans = np.arange(200) // 2
    assert not beats_base_rate(label, right, plans, np.tile([1.0, 0.5], 100))
    assert beats_base_rate(label, ~right | (plans < 60), plans, np.tile([1.0, 1.0], 100))


# What labels alone show


def test_labels_that_mostly_say_already_diverged_are_noticed(rng):
    (warning,) = Summary.of(pushed_box(rng)).warnings
    assert warning.startswith("94% of the Unreliable labels follow a divergence")
    assert "labels='executed'" in warning
    assert Summary.of(executed_steps(rng)).warnings == []


def test_half_of_all_labels_after_a_divergence_are_no_reason_to_warn(rng):
    """The paper's arm learns well from such labels."""
    plans = [[RELIABLE] * 10 + [UNRELIABLE] * 11 for _ in range(40)]
    assert Summary.of(table(np.zeros((840, 1)), plans)).warnings == []


def collected(capsys, **parameters):
    planner = BiasedRRTConnect(None, max_iterations=2000)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        collect_transitions(Disc(**parameters), planner, 80, random_state=0, verbose=1)
    return [line for line in capsys.readouterr().err.splitlines() if "Warning" in line]


def test_collection_shows_the_first_warning_and_only_one(capsys):
    (line,) = collected(capsys, sticky=False)
    assert line.startswith("Warning: ")


def test_collection_shows_none_without_a_reason(capsys):
    assert collected(capsys, sticky=True) == []
