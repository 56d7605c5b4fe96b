"""Sets of features side by side: the figures of diagnose, and which differences are no chance."""

import json

import numpy as np
import pytest
from labelled_tables import Table, executed_steps, scripted, table
from scipy.stats import permutation_test
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import balanced_accuracy_score
from sklearn.model_selection import GroupKFold, cross_val_predict
from toy_systems import Disc

from planners import BiasedRRTConnect
from reliability import collect_transitions, compare_features, diagnose


def noisy(rng, **arguments):
    """Make transitions, and a set of features of noise beside the one that tells the labels."""
    data = executed_steps(rng, **arguments)
    return data, rng.normal(size=(len(data), 2))


def test_each_set_has_the_figures_of_its_own_diagnosis(rng):
    data, noise = noisy(rng)
    comparison = compare_features(LogisticRegression(), data, {"noise": noise, "table": Table(3)})
    alone = diagnose(LogisticRegression(), data, Table(3))
    assert list(comparison.diagnoses) == ["noise", "table"]
    assert comparison.diagnoses["table"].to_dict() == alone.to_dict()
    assert comparison.diagnoses["noise"].balanced_accuracy < 0.6
    assert list(comparison.p_values) == ["table"]
    assert comparison.p_values["table"]["balanced_accuracy"] < 1e-6


def test_differences_by_chance_are_not_called_differences(rng):
    data, noise = noisy(rng, n_plans=60)
    sets = {f"noise {i}": rng.normal(size=noise.shape) for i in range(8)}
    found = compare_features(LogisticRegression(), data, sets).p_values
    assert min(own["balanced_accuracy"] for own in found.values()) > 0.05
    same = compare_features(LogisticRegression(), data, {"one": noise, "again": noise.copy()})
    assert set(same.p_values["again"].values()) == {1.0}


def test_transitions_of_one_plan_count_as_one_observation(rng):
    """100 equal transitions in each of 8 plans look like 800, and are 8."""
    labels = np.repeat(np.arange(8) % 2, 100).reshape(8, 100)
    X = np.column_stack([labels.ravel(), labels.ravel()]).astype(float)
    one, other = X.copy(), X.copy()
    one[:200, 0] = 1 - one[:200, 0]
    data = table(X, labels, executed=True)
    comparison = compare_features(scripted().estimator, data, {"one": one, "other": other})
    balanced = [d.balanced_accuracy for d in comparison.diagnoses.values()]
    assert balanced == pytest.approx([0.75, 1.0])
    assert comparison.p_values["other"]["balanced_accuracy"] > 0.1


def test_p_values_agree_with_a_permutation_test_and_count_the_sets(rng):
    data, noise = noisy(rng, n_plans=50, noise=1.5)
    weak = data.reduced[:, :1] + 1.2 * rng.normal(size=(len(data), 1))
    good = data.reduced[:, :1]
    model = LogisticRegression()
    comparison = compare_features(model, data, {"weak": weak, "good": good})
    p = comparison.p_values["good"]["balanced_accuracy"]
    folds = list(GroupKFold(5).split(noise, data.y, data.plan))
    answers = [cross_val_predict(model, X, data.y, cv=folds) for X in (weak, good)]
    weight = 1 / np.bincount(data.y)[data.y]
    gain = weight * ((answers[1] == data.y).astype(float) - (answers[0] == data.y))
    assert comparison.diagnoses["good"].balanced_accuracy - comparison.diagnoses[
        "weak"
    ].balanced_accuracy == pytest.approx(gain.sum() / 2)
    assert balanced_accuracy_score(data.y, answers[1]) == pytest.approx(
        comparison.diagnoses["good"].balanced_accuracy
    )
    gains = np.bincount(data.plan, gain)
    reference = permutation_test(
        (gains,), np.sum, permutation_type="samples", n_resamples=5000, rng=0
    )
    assert p == pytest.approx(reference.pvalue, abs=0.02)
    three = compare_features(model, data, {"weak": weak, "good": good, "noise": noise})
    assert three.p_values["good"]["balanced_accuracy"] == pytest.approx(min(1, 2 * p))


def test_the_table_marks_what_is_beyond_chance(rng):
    data, noise = noisy(rng)
    sets = {"noise": noise, "other noise": rng.normal(size=noise.shape), "table": Table(3)}
    comparison = compare_features(LogisticRegression(), data, sets)
    lines = str(comparison).splitlines()
    assert lines[0].startswith("960 transitions of 120 plans")
    for line, (name, diagnosis) in zip(lines[2:5], comparison.diagnoses.items(), strict=True):
        p_values = comparison.p_values.get(name, {})
        assert line.startswith(name)
        assert line.count("*") == sum(p < 0.05 for p in p_values.values())
        assert f"{diagnosis.expected_calibration_error:.3f}" in line
    assert f"{comparison.diagnoses['table'].balanced_accuracy:.3f} *" in lines[4]
    assert repr(comparison) == str(comparison)
    numbers = json.loads(json.dumps(comparison.to_dict(), allow_nan=False))
    assert numbers["p_values"] == comparison.p_values
    assert set(numbers["diagnoses"]) == set(sets)


def test_families_of_scenes_are_described_each_by_its_system():
    systems = [Disc(), Disc(sticky=False)]
    planner = BiasedRRTConnect(None, max_iterations=2000)
    data = collect_transitions(systems, planner, 40, labels="executed", random_state=0)
    shown = {"states": data.reduced, "own": systems}
    comparison = compare_features(LogisticRegression(), data, shown)
    assert len(comparison.diagnoses["own"].feature_ranges) == 4


def test_labels_that_are_all_alike_leave_figures_unknown(rng):
    data = table(rng.normal(size=(30, 2)), np.ones((10, 3), dtype=int), executed=True)
    comparison = compare_features(LogisticRegression(), data, {"a": Table(), "b": data.reduced})
    assert np.isnan(list(comparison.p_values["b"].values())).all()
    assert comparison.to_dict()["p_values"]["b"]["onset_recall"] is None
    assert "nan" in str(comparison)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"feature_sets": {"one": Table(3)}}, "feature_sets must be a dict of at least two"),
        ({"feature_sets": [Table(3), Table(3)]}, "feature_sets must be a dict"),
        ({"feature_sets": {"a": Table(3), "b": np.zeros((3, 2))}}, r"\['b'\] must have a row for"),
        ({"feature_sets": {"a": Table(3), "b": np.zeros(960)}}, r"\['b'\] must have a row for"),
        ({"feature_sets": {"a": Table(3), "b": None}}, "system must be a System"),
        ({"estimator": scripted()}, "estimator must be one that can be trained anew"),
        ({"cv": 1}, "cv must be at least 2"),
    ],
)
def test_unfit_arguments_are_named(rng, arguments, message):
    data = executed_steps(rng)
    good = {"estimator": LogisticRegression(), "feature_sets": {"a": Table(3), "b": Table(3)}}
    with pytest.raises(ValueError, match=message):
        compare_features(transitions=data, **{**good, **arguments})
