"""What a diagnosis says: its numbers, and which warnings come when."""

import json
import re

import joblib
import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from labelled_tables import Table, executed_steps, pushed_box, scripted, table
from sklearn.dummy import DummyClassifier
from sklearn.frozen import FrozenEstimator
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import LinearSVC
from toy_systems import Disc

from planners import BiasedRRTConnect
from reliability import (
    MLP,
    RELIABLE,
    UNRELIABLE,
    TransitionReliabilityClassifier,
    Transitions,
    collect_transitions,
    diagnose,
)

mpl.use("Agg")


class Sure(LogisticRegression):
    """Right as often as its parent, and surer of it than it should be."""

    def predict_proba(self, X):
        return np.round(super().predict_proba(X))


class Recorder(LogisticRegression):
    """Notes what it is trained on."""

    seen = []  # noqa: RUF012

    def fit(self, X, y, groups=None):
        Recorder.seen.append((len(y), groups))
        return super().fit(X, y)


def quick_network(**parameters):
    small = MLP(hidden_layer_sizes=(32,))
    return TransitionReliabilityClassifier(
        small, max_epochs=5, learning_rate=0.02, random_state=0, **parameters
    )


def has_warning(diagnosis, words):
    return any(re.search(words, sentence) for sentence in diagnosis.warnings)


def faults(diagnosis):
    """Return the warnings without the one that says which k, which comes wherever k matters."""
    return [sentence for sentence in diagnosis.warnings if not sentence.startswith("k=1 lets")]


# Numbers, against plain references


@st.composite
def answered_plans(draw):
    plans = draw(st.lists(st.lists(st.integers(0, 1), min_size=1, max_size=6), min_size=1))
    n = sum(map(len, plans))
    answers = draw(st.lists(st.integers(0, 1), min_size=n, max_size=n))
    hundredths = st.integers(0, 100).map(lambda i: i / 100)
    return plans, answers, draw(st.lists(hundredths, min_size=n, max_size=n)), draw(st.booleans())


def expected_error(labels, probabilities):
    total = 0
    for i in range(10):
        # A probability on an edge belongs to the lower bin.
        own = [
            (p, y)
            for p, y in zip(probabilities, labels, strict=True)
            if i / 10 < p <= (i + 1) / 10 or (i == p == 0)
        ]
        total += abs(sum(p for p, _ in own) - sum(y for _, y in own))
    return total / len(labels)


@given(answered_plans())
@settings(derandomize=True, deadline=None, max_examples=60)
def test_numbers_are_those_counted_by_hand(case):
    plans, answers, probabilities, executed = case
    labels = [label for plan in plans for label in plan]
    data = table(np.column_stack([answers, probabilities]), plans, executed=executed)
    diagnosis = diagnose(scripted(), data, Table())
    n_unreliable = labels.count(UNRELIABLE)
    assert diagnosis.base_rate == pytest.approx(max(n_unreliable, labels.count(1)) / len(labels))
    assert diagnosis.labels.executed_share == executed
    if len(set(labels)) == 1:
        assert diagnosis.n_folds is None
        assert np.isnan([diagnosis.accuracy, diagnosis.onset_recall]).all()
        return
    onset = [
        label == UNRELIABLE and (executed or i == 0 or plan[i - 1] == RELIABLE)
        for plan in plans
        for i, label in enumerate(plan)
    ]
    right = [a == b for a, b in zip(labels, answers, strict=True)]

    def recall(of):
        chosen = [r for r, one in zip(right, of, strict=True) if one]
        return sum(chosen) / len(chosen)

    recalls = [recall([label == one for label in labels]) for one in (UNRELIABLE, RELIABLE)]
    assert diagnosis.accuracy == pytest.approx(sum(right) / len(right))
    assert [diagnosis.unreliable_recall, diagnosis.reliable_recall] == pytest.approx(recalls)
    assert diagnosis.balanced_accuracy == pytest.approx(sum(recalls) / 2)
    assert diagnosis.onset_recall == pytest.approx(recall(onset))
    assert diagnosis.already_diverged_share == pytest.approx(1 - sum(onset) / n_unreliable)
    assert diagnosis.expected_calibration_error == pytest.approx(
        expected_error(labels, probabilities)
    )


def test_estimators_are_judged_on_plans_that_they_have_not_seen(rng):
    """Rows of one plan are alike here, so that a nearest neighbour knows any row of it."""
    places, labels = rng.normal(size=(200, 2)), rng.integers(0, 2, 200)
    data = table(np.repeat(places, 5, axis=0), np.repeat(labels, 5).reshape(200, 5), executed=True)
    nearest = KNeighborsClassifier(1)
    diagnosis = diagnose(nearest, data, Table())
    assert diagnosis.n_folds == 5
    assert 0.4 < diagnosis.balanced_accuracy < 0.6
    assert not hasattr(nearest, "classes_"), "a clone is trained"
    fitted = nearest.fit(data.reduced, data.y)
    assert diagnose(fitted, data, Table()).accuracy == diagnosis.accuracy, "fitted or not"
    assert diagnose(FrozenEstimator(fitted), data, Table()).accuracy == 1.0


def test_it_does_not_depend_on_processes_and_trains_as_often_as_it_is_told(rng):
    data = executed_steps(rng, noise=0.5)
    first = diagnose(LogisticRegression(), data, Table(3), cv=3)
    with joblib.parallel_config("threading"):
        second = diagnose(LogisticRegression(), data, Table(3), cv=3, n_jobs=2)
    assert first.to_dict() == second.to_dict()
    assert first.n_folds == 3
    assert diagnose(LogisticRegression(), data[:16], Table(3)).n_folds == 2, "of two plans"


@pytest.mark.parametrize(
    "wrap", [lambda one: one, lambda one: make_pipeline(StandardScaler(), one)]
)
def test_plan_ids_are_given_to_a_fit_that_takes_groups(rng, wrap):
    data = executed_steps(rng, n_plans=20)
    Recorder.seen.clear()
    diagnose(wrap(Recorder()), data, Table(3))
    assert len(Recorder.seen) == 5
    assert all(len(groups) == n == 16 * 8 for n, groups in Recorder.seen)
    assert {len(np.unique(groups)) for _, groups in Recorder.seen} == {16}


def test_a_search_splits_by_plans(rng):
    data = executed_steps(rng, n_plans=20)
    search = GridSearchCV(LogisticRegression(), {"C": [0.1, 1.0]}, cv=GroupKFold(3))
    assert diagnose(search, data, Table(3)).accuracy > 0.9


def test_trainings_on_parts_leave_the_checkpoint_alone(rng, tmp_path):
    data = executed_steps(rng, n_plans=60)
    file = tmp_path / "training"
    network = quick_network(checkpoint=file).fit(data.reduced, data.y, groups=data.plan)
    before = file.read_bytes()
    for estimator in (network, make_pipeline(StandardScaler(), network)):
        assert diagnose(estimator, data, Table(3), cv=2).n_folds == 2
    assert file.read_bytes() == before
    assert network.checkpoint == file


def test_scenes_of_a_family_are_each_described_by_their_system():
    systems = [Disc(), Disc(sticky=False)]
    planner = BiasedRRTConnect(None, max_iterations=2000)
    data = collect_transitions(systems, planner, 60, labels="both", random_state=0)
    diagnosis = diagnose(LogisticRegression(), data, systems)
    assert diagnosis.n_folds == 5
    assert 0 < diagnosis.labels.executed_share < 1
    with pytest.raises(ValueError, match="2 scenes"):
        diagnose(LogisticRegression(), data, systems[0])


def test_without_probabilities_calibration_is_unknown(rng):
    diagnosis = diagnose(LinearSVC(), executed_steps(rng), Table(3))
    assert np.isnan(diagnosis.expected_calibration_error)
    assert diagnosis.accuracy > 0.9
    assert diagnosis.to_dict()["expected_calibration_error"] is None
    assert re.search(r"calibration error +unknown", str(diagnosis))
    assert faults(diagnosis) == []


def test_voxel_grids_are_judged_and_not_blamed_for_empty_space(rng):
    X = rng.integers(0, 256, (160, 8))
    X[:, :3] = [0, 7, 7]
    labels = (X[:, 4] > 127).astype(int).reshape(40, 4)
    data = table(X, labels, executed=True)
    diagnosis = diagnose(KNeighborsClassifier(), data, Table(8, np.uint8))
    assert diagnosis.constant_features == ()
    assert diagnosis.duplicate_features == ()
    assert diagnosis.unscaled_features == ()
    assert not has_warning(diagnosis, "Feature|features")
    empty = table(np.zeros((160, 8)), labels, executed=True)
    empty = diagnose(DummyClassifier(), empty, Table(8, np.uint8))
    assert empty.warnings[0].startswith("All features are constant")


# Warnings: each where it must be, and not where it mustn't


@pytest.mark.parametrize("estimator", [LogisticRegression(), quick_network()])
def test_the_pushed_box_is_told_to_collect_other_labels(rng, estimator):
    diagnosis = diagnose(estimator, pushed_box(rng), Table(4))
    assert diagnosis.base_rate == pytest.approx(0.935, abs=0.003)
    assert diagnosis.already_diverged_share == pytest.approx(0.94, abs=0.005)
    first = diagnosis.warnings[0]
    assert first.startswith("Accuracy 0.93")
    assert "no better than the base rate 0.93" in first
    assert "94% of the Unreliable labels follow a divergence" in first
    assert first.endswith("collect with labels='executed'.")
    assert len(diagnosis.warnings) == 1


def test_of_both_kinds_of_labels_the_executed_ones_are_to_be_kept(rng):
    box = pushed_box(rng)
    onsets = box[box.step == 1]
    onsets.executed[:] = True
    joined = Transitions.concatenate([box, onsets])
    assert "keep transitions[transitions.executed]." in joined_warning(joined)


def joined_warning(data):
    return diagnose(DummyClassifier(), data, Table(4)).warnings[0]


def test_where_all_is_well_only_k_is_advised(rng):
    for estimator in (LogisticRegression(), make_pipeline(StandardScaler(), quick_network())):
        diagnosis = diagnose(estimator, executed_steps(rng, n_plans=300), Table(3))
        assert diagnosis.beats_base_rate
        assert diagnosis.accuracy > 0.9
        (only,) = diagnosis.warnings
        assert only.startswith("k=1 lets")


def test_features_of_noise_are_blamed_where_labels_are_sound(rng):
    labels = rng.integers(0, 2, (100, 6))
    diagnosis = diagnose(
        LogisticRegression(), table(rng.normal(size=(600, 2)), labels, executed=True), Table()
    )
    assert not diagnosis.beats_base_rate
    assert "base rate" in diagnosis.warnings[0]
    assert "let system.features describe" in diagnosis.warnings[0]
    assert "executed" not in diagnosis.warnings[0]


def test_an_accuracy_below_the_base_rate_is_no_fault_of_one_who_sees_both_labels_alike(rng):
    data = executed_steps(rng, n_plans=200, noise=0.7, bias=1.9)
    assert data.y.mean() < 0.1
    diagnosis = diagnose(LogisticRegression(class_weight="balanced"), data, Table(3))
    assert diagnosis.accuracy < diagnosis.base_rate
    assert not diagnosis.beats_base_rate
    assert diagnosis.balanced_accuracy > 0.75
    assert not has_warning(diagnosis, "base rate")


def test_knowing_only_what_follows_a_divergence_is_noticed(rng):
    """The feature tells where executions are that have diverged, and not what made them."""
    plans = [[RELIABLE] * 6 + [UNRELIABLE] * 6 for _ in range(100)]
    after = np.tile(np.arange(12) > 6, 100) + 0.01 * rng.normal(size=1200)
    data = table(np.column_stack([after, rng.normal(size=1200)]), plans)
    diagnosis = diagnose(LogisticRegression(), data, Table())
    assert diagnosis.unreliable_recall > 0.8
    assert diagnosis.onset_recall < 0.1
    assert diagnosis.warnings[0].startswith("Only 0% of the transitions at which executions div")
    assert "labels='executed'" in diagnosis.warnings[0]
    known = np.tile(np.arange(12) > 5, 100) + 0.01 * rng.normal(size=1200)
    well = diagnose(
        LogisticRegression(), table(np.column_stack([known, data.reduced[:, 1]]), plans), Table()
    )
    assert well.onset_recall == 1.0
    assert faults(well) == [], "labels of Eq. 3 that are understood are no fault"


@pytest.mark.parametrize("after_is_known", [False, True])
def test_labels_are_blamed_where_what_follows_a_divergence_looks_reliable(after_is_known):
    plans = [[RELIABLE] * 6 + [UNRELIABLE] * 6] * 60
    labels, step = np.concatenate(plans), np.tile(np.arange(12), 60)
    answers = (step != 6).astype(int)
    if after_is_known:
        of_onsets = np.repeat(np.arange(60) % 2, 12)
        answers = np.select([step < 4, step == 6, step > 9], [1, of_onsets, 1], 0)
    shares = [labels[answers == one].mean() for one in (0, 1)]
    data = table(np.column_stack([answers, np.take(shares, answers)]), plans)
    diagnosis = diagnose(scripted(), data, Table())
    assert diagnosis.balanced_accuracy < 0.7
    assert diagnosis.onset_recall >= 0.5
    (warning,) = faults(diagnosis)
    assert warning.startswith("The balanced accuracy is 0.")
    assert ("collect with labels='executed'" in warning) == (not after_is_known)
    assert ("let system.features" in warning) == after_is_known


def answers_with_recalls(rng, of_unreliable, of_reliable, unreliable_share=0.5, n_plans=400):
    """Make executed transitions, and answers that are right for such shares of each label."""
    labels = (np.linspace(0, 1, 5 * n_plans) >= unreliable_share).astype(int)
    rank = np.concatenate([np.linspace(0, 1, n) for n in np.bincount(labels)])
    right = rank <= np.where(labels == RELIABLE, of_reliable, of_unreliable)
    order = rng.permutation(len(labels))
    answers = np.where(right, labels, 1 - labels)[order]
    shares = [np.mean(labels[order][answers == one]) for one in (0, 1)]
    X = np.column_stack([answers, np.take(shares, answers)])
    return table(X, labels[order].reshape(n_plans, 5), executed=True)


@pytest.mark.parametrize(
    ("recalls", "words"),
    [
        ((0.45, 0.99), "Only 45% of the transitions at which executions diverge.*plans go through"),
        ((0.65, 0.65), "The balanced accuracy is 0.65, and 0.5 is chance"),
        ((0.9, 0.9), None),
        ((0.55, 0.95), None),
    ],
)
def test_the_label_that_is_not_recognized_is_named(rng, recalls, words):
    diagnosis = diagnose(scripted(), answers_with_recalls(rng, *recalls), Table())
    assert diagnosis.n_folds == 0
    assert [diagnosis.unreliable_recall, diagnosis.reliable_recall] == pytest.approx(
        recalls, abs=0.01
    )
    assert len(faults(diagnosis)) == (words is not None)
    assert words is None or re.search(words, diagnosis.warnings[0])


@pytest.mark.parametrize("executed", [True, False])
@pytest.mark.parametrize(
    ("recalls", "costs"),
    [((0.9, 0.95), None), ((0.9, 0.71), None), ((0.9, 0.69), "0.69"), ((0.99, 0.45), "0.45")],
)
def test_the_advice_on_k_weighs_what_it_lets_through_against_what_it_costs(
    rng, recalls, costs, executed
):
    data = answers_with_recalls(rng, *recalls)
    data.executed[:] = executed
    diagnosis = diagnose(scripted(), data, Table())
    (advice,) = diagnosis.warnings
    missed = 1 - diagnosis.unreliable_recall
    at_random = diagnosis.unreliable_recall * np.exp(-diagnosis.accuracy)
    assert diagnosis.accepted_unreliable(1) == pytest.approx(missed + at_random)
    assert diagnosis.accepted_unreliable(np.inf) == pytest.approx(missed)
    assert advice.startswith(f"k=1 lets {missed + at_random:.0%} of Unreliable transitions through")
    assert f"k=10 {diagnosis.accepted_unreliable(10):.0%}: use k=10" in advice
    lost = 1 - diagnosis.reliable_recall
    assert (f"costs {lost:.0%} of the Reliable ones." in advice) == (costs is None)
    assert (f"recall of Reliable of {costs} many transitions are lost" in advice) == bool(costs)
    assert ("collect with labels='executed' first" in advice) == (bool(costs) and not executed)


def test_there_are_no_more_warnings_than_one_reads(rng):
    """Few plans, missed onsets, k, calibration, a constant and a duplicate feature are six."""
    plans = [[RELIABLE] * 2 + [UNRELIABLE] * (i < 15) for i in range(80)]
    y = np.concatenate(plans)
    answers = (y == RELIABLE) | (np.cumsum(y == UNRELIABLE) > 7)
    X = np.column_stack([answers, 1.0 - answers, np.ones(len(y)), answers])
    diagnosis = diagnose(scripted(), table(X, plans), Table(4))
    assert len(diagnosis.warnings) == 5
    assert "has the same value" in diagnosis.warnings[-1]


def test_overconfidence_is_noticed(rng):
    data = executed_steps(rng, noise=0.8)
    assert faults(diagnose(LogisticRegression(), data, Table(3))) == []
    (warning,) = faults(diagnose(Sure(), data, Table(3)))
    assert re.match(r"Probabilities are off by 0\.\d\d on average.*CalibratedClassifierCV", warning)


@pytest.mark.parametrize(("n_bad", "few"), [(1, True), (19, True), (20, False), (60, False)])
def test_figures_of_few_plans_are_called_uncertain(rng, n_bad, few):
    plans = [[RELIABLE] * 4 + [UNRELIABLE] * (i < n_bad) for i in range(120)]
    y = np.concatenate(plans)
    X = np.column_stack([y + 0.01 * rng.normal(size=len(y)), rng.normal(size=len(y))])
    diagnosis = diagnose(LogisticRegression(), table(X, plans), Table())
    assert has_warning(diagnosis, f"Only {n_bad} of 120 plans ha(s|ve) Unreliable tran") == few
    if few:
        assert "collect more plans" in diagnosis.warnings[0]
    else:
        assert faults(diagnosis) == []


@pytest.mark.parametrize(("label", "word"), [(RELIABLE, "Reliable"), (UNRELIABLE, "Unreliable")])
@pytest.mark.parametrize("executed", [True, False])
def test_one_label_is_nothing_to_learn_from(rng, label, word, executed):
    data = table(rng.normal(size=(90, 2)), np.full((30, 3), label), executed=executed)
    diagnosis = diagnose(LogisticRegression(), data, Table())
    (warning,) = diagnosis.warnings
    assert warning.startswith(f"All 90 labels are {word}, so that there is nothing to learn")
    assert ("labels='executed'" in warning) == (label == UNRELIABLE and not executed)
    assert "unknown" in str(diagnosis)
    diagnosis.plot()


def test_one_plan_cannot_be_judged(rng):
    diagnosis = diagnose(LogisticRegression(), table(rng.normal(size=(3, 2)), [[1, 1, 0]]), Table())
    assert diagnosis.n_folds is None
    assert "Only 1 of 1 plan has Unreliable" in diagnosis.warnings[0]


def test_a_label_that_only_one_plan_has_is_not_trained_on_elsewhere(rng):
    data = table(rng.normal(size=(15, 2)), [[1, 1, 0], *[[1, 1, 1]] * 4])
    diagnosis = diagnose(LogisticRegression(), data, Table())
    assert diagnosis.unreliable_recall == 0.0
    assert diagnosis.n_folds == 5


def test_constant_duplicate_and_unscaled_features_are_named(rng):
    sound = executed_steps(rng).reduced
    X = np.column_stack([sound, sound[:, 1], np.zeros(len(sound)), 100 * sound[:, 2]])
    data = table(X, executed_steps(np.random.default_rng(0)).y.reshape(120, 8), executed=True)
    X[:, 4] = [-0.0, 0.0] * (len(X) // 2)
    network = diagnose(quick_network(), data, Table(6), cv=2)
    assert network.constant_features == (4,)
    assert network.duplicate_features == ((1, 3),)
    assert network.unscaled_features == (5,)
    assert has_warning(network, "Feature 4 has the same value in all transitions: leave out")
    assert has_warning(network, r"equal in all transitions \(3 equals 1\): leave one out")
    assert has_warning(network, "Feature 5 has values far from order one.*StandardScaler")
    scaled = diagnose(make_pipeline(StandardScaler(), quick_network()), data, Table(6), cv=2)
    assert scaled.unscaled_features == ()
    np.testing.assert_array_equal(network.feature_ranges[:, 0], X.min(axis=0))
    np.testing.assert_array_equal(network.feature_ranges[:, 1], X.max(axis=0))


def test_many_features_are_not_all_listed(rng):
    labels = executed_steps(rng).y.reshape(120, 8)
    X = np.column_stack([rng.normal(size=(960, 1)), np.ones((960, 30))])
    diagnosis = diagnose(DummyClassifier(), table(X, labels, executed=True), Table(31))
    assert has_warning(diagnosis, "Features 1, 2, 3, 4, 5, 6, 7, 8 and 22 more have the same")
    only = diagnose(DummyClassifier(), table(X[:, 1:], labels, executed=True), Table(30))
    assert only.warnings[0].startswith("All features are constant")


# How it is shown


def test_the_table_says_what_the_numbers_are(rng):
    diagnosis = diagnose(LogisticRegression(), pushed_box(rng), Table(4))
    lines = str(diagnosis).splitlines()
    assert lines[0].endswith("clone that has not seen its plan (5 folds)")
    shown = {line[:44].strip(): line[44:].strip() for line in lines[1:16]}
    assert shown["accuracy"] == f"{diagnosis.accuracy:.3f}"
    assert shown["base rate (one label for every transition)"] == f"{diagnosis.base_rate:.3f}"
    assert shown["of these, only say: already diverged"].startswith("0.93")
    assert shown["recall of divergence onsets"] == f"{diagnosis.onset_recall:.3f}"
    assert shown["features"] == "4"
    assert lines[-1] == f"1. {diagnosis.warnings[0]}"
    through = diagnosis.accepted_unreliable(10)
    assert shown["Unreliable that k=10 lets through"] == f"{through:.3f}"
    assert max(map(len, lines[:16])) < 100
    assert repr(diagnosis) == str(diagnosis)


def test_json_holds_all_numbers(rng):
    diagnosis = diagnose(LogisticRegression(), pushed_box(rng), Table(4))
    numbers = json.loads(json.dumps(diagnosis.to_dict(), allow_nan=False))
    assert numbers == diagnosis.to_dict()
    assert numbers["warnings"] == diagnosis.warnings
    for name in ("accuracy", "base_rate", "already_diverged_share", "expected_calibration_error"):
        assert numbers[name] == getattr(diagnosis, name)
    assert sum(numbers["calibration"]["n_transitions"]) == numbers["n_transitions"]


def test_the_picture_shows_curve_recalls_and_ranges(rng):
    data = executed_steps(rng, noise=0.5)
    data = table(np.column_stack([data.reduced, np.ones(len(data))]), data.y.reshape(120, 8))
    diagnosis = diagnose(LogisticRegression(), data, Table(4))
    calibration, recalls, ranges = diagnosis.plot()
    (curve,) = [line for line in calibration.lines if line.get_label() == "estimator"]
    np.testing.assert_array_equal(curve.get_ydata(), diagnosis.calibration.observed)
    assert sum(bar.get_height() for bar in calibration.patches) == pytest.approx(1)
    widths = [bar.get_width() for bar in recalls.patches]
    assert widths == [
        diagnosis.accuracy,
        diagnosis.balanced_accuracy,
        diagnosis.reliable_recall,
        diagnosis.unreliable_recall,
        diagnosis.onset_recall,
    ]
    assert diagnosis.base_rate in [line.get_xdata()[0] for line in recalls.lines]
    drawn = {c.get_label(): len(c.get_segments()) for c in ranges.collections}
    assert drawn == {"fit to learn from": 3, "constant, duplicate or not of order one": 1}
    _, given = mpl.pyplot.subplots(1, 3)
    assert diagnosis.plot(given) is given


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"transitions": [1, 2]}, "transitions must be Transitions"),
        ({"transitions": table(np.zeros((1, 2)), [[1]])[:0]}, "at least one"),
        ({"estimator": LogisticRegression}, "estimator must be a classifier"),
        ({"estimator": None}, "estimator must be a classifier"),
        ({"cv": 1}, "cv must be at least 2"),
        ({"cv": 2.5}, "cv must be a positive integer"),
        ({"system": None}, "system must be a System"),
    ],
)
def test_unfit_arguments_are_named(rng, arguments, message):
    good = {"estimator": LogisticRegression(), "transitions": executed_steps(rng)}
    with pytest.raises(ValueError, match=message):
        diagnose(**{**good, "system": Table(3), **arguments})
