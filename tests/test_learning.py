"""Learning in rounds: the same however it was cut up, and reports that say what is true."""

import shutil
from dataclasses import replace
from math import comb

import numpy as np
import pytest
import scipy.stats
from sklearn.base import BaseEstimator, ClassifierMixin, clone
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import balanced_accuracy_score
from sklearn.model_selection import StratifiedGroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeClassifier
from test_transitions import assert_equal
from toy_systems import Disc

from planners import BiasedRRTConnect, PlanStatus
from reliability import (
    RELIABLE,
    UNRELIABLE,
    PlanFailedError,
    ResumableStore,
    StoreError,
    TransitionReliabilityClassifier,
    collect_transitions,
    learn_in_rounds,
)

N_PLANS, N_VALIDATION, K, SEED = 25, 10, 3.0, 2
# One that looks at a feature at random in each split learns from each of three rounds.
TREE = DecisionTreeClassifier(max_depth=4, max_features=1)


def learn(estimator=TREE, system=None, k=1.0, **parameters):
    planner = BiasedRRTConnect(None, k=k, max_iterations=300)
    defaults = {"n_rounds": 3, "n_plans": N_PLANS, "n_validation": N_VALIDATION}
    defaults |= {"labels": "executed", "n_after": 1, "exploring_k": K, "random_state": SEED}
    return learn_in_rounds(estimator, planner, system or Disc(), **defaults | parameters)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("learning") / "whole"


@pytest.fixture(scope="module")
def whole(folder):
    return learn(path=folder)


def contents(folder):
    files = [file for file in folder.rglob("*") if file.is_file()]
    return {str(file.relative_to(folder)): file.read_bytes() for file in files}


def without_seconds(result):
    return [{**vars(report), "seconds": 0.0} for report in result.rounds]


def assert_alike(result, expected):
    assert_equal(result.transitions, expected.transitions)
    np.testing.assert_array_equal(result.round, expected.round)
    np.testing.assert_equal(without_seconds(result), without_seconds(expected))
    X = expected.transitions.features(Disc())
    np.testing.assert_array_equal(
        result.estimator.predict_proba(X), expected.estimator.predict_proba(X)
    )
    assert result.stopped_early == expected.stopped_early
    assert result.kept_round == expected.kept_round


def test_rounds_are_apart_and_known(whole):
    assert not whole.stopped_early
    assert [report.round for report in whole.rounds] == [0, 1, 2]
    assert np.unique(whole.round).tolist() == [0, 1, 2]
    np.testing.assert_array_equal(whole.transitions.plan // N_PLANS, whole.round)
    starts = whole.transitions.reduced[whole.transitions.step == 0]
    assert len(np.unique(starts, axis=0)) == len(starts), "no problem is asked twice"
    assert whole.transitions.executed.all()


def test_each_round_is_collected_with_what_the_last_one_learned(whole, folder):
    for number in range(3):
        store = ResumableStore.at(folder / f"round-{number}")
        estimator = store.description["planner"]["parameters"]["estimator"]
        assert store.description["planner"]["parameters"]["k"] == K
        assert (estimator is None) == (number == 0)
    first, last = whole.rounds[0], whole.rounds[-1]
    assert last.n_succeeded / last.n_solved > first.n_succeeded / first.n_solved


def test_reports_are_those_of_plain_references(whole):
    system = Disc()
    for report in whole.rounds:
        rows = whole.transitions[whole.round == report.round]
        share = np.mean(rows.y == RELIABLE)
        assert report.base_rate == pytest.approx(max(share, 1 - share))
        assert report.n_transitions == len(rows)
        assert report.n_learned == np.sum(whole.round <= report.round)
        assert report.p_acc == pytest.approx(cross_validated(whole, report.round)[0])
        _, of_all, of_round, _ = cross_validated(whole, report.round)
        assert report.cross_validated_balanced_accuracy == pytest.approx(of_all)
        assert report.updated_balanced_accuracy == pytest.approx(of_round)
        if report.round == 0:
            assert np.isnan(report.unseen_balanced_accuracy)
            assert report.success_improved is report.accuracy_improved is None
            continue
        before = learn(n_rounds=report.round).estimator
        guessed = before.predict(rows.features(system))
        expected = balanced_accuracy_score(rows.y, guessed)
        assert report.unseen_balanced_accuracy == pytest.approx(expected)
        _, _, _, right = cross_validated(whole, report.round)
        p_value = p_value_of_plans(right, guessed == rows.y, rows)
        assert report.accuracy_improved == (p_value < 0.05)
    assert any(report.accuracy_improved for report in whole.rounds)
    kept = whole.rounds[whole.kept_round]
    assert whole.estimator.validation_accuracy_ == kept.p_acc


def cross_validated(whole, number):
    """Accuracy on all rows up to a round, and balanced accuracies on these and on the round's."""
    rows, rounds = whole.transitions[whole.round <= number], whole.round[whole.round <= number]
    X, seed = rows.features(Disc()), fit_seed(number)
    folds = StratifiedGroupKFold(5, shuffle=True, random_state=seed % 2**32)
    guessed = np.full(len(rows), -1)
    for training, held_out in folds.split(X, rows.y, rows.plan):
        tree = clone(TREE).set_params(random_state=seed % 2**31)
        guessed[held_out] = tree.fit(X[training], rows.y[training]).predict(X[held_out])
        assert not np.isin(rows.plan[training], rows.plan[held_out]).any()
    last = rounds == number
    return (
        np.mean(guessed == rows.y),
        balanced_accuracy_score(rows.y, guessed),
        balanced_accuracy_score(rows.y[last], guessed[last]),
        (guessed == rows.y)[last],
    )


def p_value_of_plans(right, right_before, rows):
    """Test whether plans add to the balanced accuracy, by Student's formula."""
    shares = []
    for plan in np.unique(rows.plan):
        gains = [
            (int(right[i]) - int(right_before[i])) / np.sum(rows.y == rows.y[i])
            for i in np.flatnonzero(rows.plan == plan)
        ]
        shares.append(sum(gains))
    t = np.mean(shares) / (np.std(shares, ddof=1) / np.sqrt(len(shares)))
    return scipy.stats.t.sf(t, len(shares) - 1)


def fit_seed(number):
    drawn = np.random.SeedSequence(SEED, spawn_key=(number, 0, 0)).generate_state(2, np.uint64)
    return int(drawn[1]) >> 1


@pytest.fixture
def plans(monkeypatch):
    """Problems, results and planners of all plans that are made."""
    made, plan = [], BiasedRRTConnect.plan

    def recorded(planner, start_reduced, goal):
        made.append((start_reduced, plan(planner, start_reduced, goal), planner))
        return made[-1][1]

    monkeypatch.setattr(BiasedRRTConnect, "plan", recorded)
    return made


def n_succeeded(results):
    solved = [one for one in results if one.success]
    rollouts = [Disc().rollout(one.reduced[0], one.commands) for one in solved]
    return sum(
        rollout.n_completed == len(plan.commands)
        and np.linalg.norm(rollout.states[-1] - plan.reduced[-1]) < 0.04
        for rollout, plan in zip(rollouts, solved, strict=True)
    )


def test_successes_are_counted_as_one_would(plans):
    (report,) = learn(n_rounds=1).rounds
    of_round, of_validation = (
        [result for _, result, planner in plans if (planner.estimator is None) == is_round]
        for is_round in (True, False)
    )
    assert (report.n_plans, report.n_validation) == (len(of_round), len(of_validation))
    assert report.n_solved == sum(result.success for result in of_round)
    assert 0 < report.n_succeeded < report.n_solved
    assert report.n_succeeded == n_succeeded(of_round)
    assert report.n_validation_succeeded == n_succeeded(of_validation)


def test_all_estimators_are_compared_on_problems_that_nothing_is_learned_from(plans):
    result = learn(n_rounds=2)
    made = [plans[N_PLANS : N_PLANS + N_VALIDATION], plans[-N_VALIDATION:]]
    starts = [np.array([start for start, _, _ in of_round]) for of_round in made]
    np.testing.assert_array_equal(*starts)
    assert len(np.unique(starts[0], axis=0)) == N_VALIDATION
    assert not np.isin(starts[0][:, 0], result.transitions.reduced[:, 0]).any()
    assert {planner.k for of_round in made for _, _, planner in of_round} == {1.0}
    first, second = ({id(planner.estimator) for _, _, planner in one} for one in made)
    assert len(first) == len(second) == 1
    assert first != second


class Spoiled(ClassifierMixin, BaseEstimator):
    """A tree, until it learns from many rows: then all is ``answer``."""

    def __init__(self, n_rows, answer):
        self.n_rows, self.answer = n_rows, answer

    def fit(self, X, y):
        self.tree_ = DecisionTreeClassifier(max_depth=4, random_state=0).fit(X, y)
        self.classes_, self.n_learned_ = np.unique(y), len(X)
        return self

    def predict(self, X):
        return (
            self.tree_.predict(X) if self.n_learned_ < self.n_rows else np.full(len(X), self.answer)
        )


def test_a_round_that_made_the_estimator_worse_is_not_kept(tmp_path):
    n_rows = learn(n_rounds=1).rounds[0].n_learned
    estimator = Spoiled(n_rows + 1, UNRELIABLE)
    result = learn(estimator, k=np.inf, n_rounds=2, path=tmp_path)
    first, second = (report.n_validation_succeeded for report in result.rounds)
    assert first > second == 0
    assert result.kept_round == 0
    assert result.estimator.n_learned_ == n_rows
    assert not result.rounds[1].success_improved
    assert len(result.transitions) > n_rows, "what was collected is not thrown away"
    assert "Kept: the estimator of round 0." in str(result)
    assert f"succeeded at {first}, 0 of {N_VALIDATION} validation problems" in str(result)
    again = learn(estimator, k=np.inf, n_rounds=2, path=tmp_path)
    assert again.kept_round == 0, "read from its folder"


def test_of_equally_good_estimators_the_one_that_learned_from_more_is_kept():
    result = learn(Spoiled(10**6, UNRELIABLE), system=Disc(sticky=True), n_rounds=2, n_validation=1)
    counts = [report.n_validation_succeeded for report in result.rounds]
    assert counts[0] == counts[1]
    assert result.kept_round == 1


def interrupt(patch, owner, name, n_before):
    """Let a method do its work some times, and then be interrupted."""
    work, calls = getattr(owner, name), []

    def interrupted(*arguments, **parameters):
        calls.append(1)
        if len(calls) > n_before:
            raise KeyboardInterrupt
        return work(*arguments, **parameters)

    patch.setattr(owner, name, interrupted)


@pytest.mark.parametrize(
    ("owner", "name", "n_before"),
    [
        (BiasedRRTConnect, "plan", 7),
        # Six fits in each round: five on parts, to measure, and one on all.
        (DecisionTreeClassifier, "fit", 5),
        (BiasedRRTConnect, "plan", N_PLANS + 3),
        (DecisionTreeClassifier, "fit", 6),
        (BiasedRRTConnect, "plan", N_PLANS + N_VALIDATION + 1),
        (DecisionTreeClassifier, "fit", 17),
        (BiasedRRTConnect, "plan", 3 * (N_PLANS + N_VALIDATION) - 1),
    ],
)
def test_interrupted_anywhere_it_goes_on_to_the_same_bytes(
    whole, folder, tmp_path, monkeypatch, owner, name, n_before
):
    with monkeypatch.context() as patch:
        interrupt(patch, owner, name, n_before)
        with pytest.raises(KeyboardInterrupt):
            learn(path=tmp_path)
    kept = contents(tmp_path)
    assert len(kept) < len(contents(folder))
    assert_alike(learn(path=tmp_path), whole)
    assert contents(tmp_path) == contents(folder)
    assert kept.items() <= contents(tmp_path).items()


def test_a_finished_folder_is_read_and_more_rounds_extend_it(whole, folder, tmp_path, monkeypatch):
    assert_alike(learn(), whole)
    first = learn(n_rounds=1, path=tmp_path)
    assert_equal(first.transitions, whole.transitions[whole.round == 0])
    with monkeypatch.context() as patch:
        interrupt(patch, BiasedRRTConnect, "plan", 2 * (N_PLANS + N_VALIDATION))
        assert_alike(learn(path=tmp_path), whole)
    interrupt(monkeypatch, BiasedRRTConnect, "plan", 0)
    interrupt(monkeypatch, DecisionTreeClassifier, "fit", 0)
    assert_alike(learn(path=tmp_path), whole)
    assert contents(tmp_path) == contents(folder)


def test_a_seed_left_open_is_the_folders(whole, folder, tmp_path):
    shutil.copytree(folder, tmp_path / "copy")
    assert_alike(learn(path=tmp_path / "copy", random_state=None), whole)


def test_the_result_does_not_depend_on_processes(whole):
    assert_alike(learn(n_jobs=2), whole)


@pytest.mark.parametrize(
    ("parameters", "told"),
    [
        ({"exploring_k": 4.0}, "planner.parameters.k: 3.0 then, 4.0 now"),
        ({"n_plans": 31}, "n_plans: 25 then, 31 now"),
        ({"labels": "plan"}, 'labels: "executed" then, "plan" now'),
        ({"n_after": 2}, "n_after: 1 then, 2 now"),
        ({"random_state": 6}, "random_state: 2 then, 6 now"),
        (
            {"estimator": DecisionTreeClassifier(max_depth=5, max_features=1)},
            "estimator.parameters.max_depth: 4",
        ),
        ({"system": Disc(sticky=False)}, "system.sticky: true then, false now"),
    ],
)
def test_other_arguments_are_refused_for_the_same_folder(whole, folder, parameters, told):
    with pytest.raises(StoreError, match=told):
        learn(path=folder, **parameters)


def test_problems_are_those_of_no_collection_with_the_same_seed(whole):
    collected = collect_transitions(
        Disc(), BiasedRRTConnect(Disc(), max_iterations=300), N_PLANS, random_state=SEED
    )
    assert not np.isin(collected.reduced[:, 0], whole.transitions.reduced[:, 0]).any()


def test_a_round_that_brings_nothing_is_the_last():
    result = learn(Constant(RELIABLE), n_rounds=4)
    assert result.stopped_early
    assert [report.brought_nothing for report in result.rounds] == [False, True]
    report = result.rounds[-1]
    assert report.success_improved is report.accuracy_improved is False
    assert report.unseen_balanced_accuracy == report.updated_balanced_accuracy == 0.5
    assert "Stopped early" in str(result)
    assert "not more, beyond chance" in str(report)
    assert not learn(Constant(RELIABLE), n_rounds=2).stopped_early


class GivesUp(BiasedRRTConnect):
    """Solves few problems with an estimator that learned from few rows."""

    def plan(self, start_reduced, goal):
        result = super().plan(start_reduced, goal)
        few = self.estimator is not None and self.estimator.n_learned_ < N_ROWS
        gives_up = few and start_reduced[1] > -0.5
        return replace(result, status=PlanStatus.ITERATION_LIMIT) if gives_up else result


N_ROWS = 600


def test_it_goes_on_as_long_as_more_plans_succeed(tmp_path):
    planner = GivesUp(None, max_iterations=300)
    result = learn_in_rounds(
        Constant(RELIABLE),
        planner,
        Disc(),
        n_rounds=4,
        n_plans=40,
        n_validation=20,
        path=tmp_path,
        random_state=0,
    )
    n_learned = [report.n_learned for report in result.rounds]
    assert n_learned[0] < N_ROWS < n_learned[1]
    assert [report.success_improved for report in result.rounds] == [None, True, False]
    assert [report.accuracy_improved for report in result.rounds] == [None, False, False]
    stores = [ResumableStore.at(tmp_path / f"validation-{i}") for i in range(3)]
    outcomes = [
        np.array([store.read(name).facts.get("succeeded", False) for name in store.names()])
        for store in stores
    ]
    for number, report in enumerate(result.rounds):
        assert report.n_validation_succeeded == outcomes[number].sum()
        if number:
            p_value = p_value_of_sign_test(outcomes[number], outcomes[number - 1])
            assert report.success_improved == (p_value < 0.05)
    assert result.stopped_early
    assert result.kept_round == 2


def p_value_of_sign_test(succeeded, before):
    """Sum up how probable as many or more heads are in as many tosses of a coin."""
    n_for, n_against = np.sum(succeeded & ~before), np.sum(before & ~succeeded)
    n = n_for + n_against
    return sum(comb(n, i) for i in range(n_for, n + 1)) / 2**n


def test_a_round_without_a_plan_brings_nothing():
    result = learn(Constant(UNRELIABLE), exploring_k=np.inf, n_rounds=4)
    assert result.stopped_early
    assert [report.n_transitions == 0 for report in result.rounds] == [False, True]
    assert result.rounds[1].n_solved == 0
    assert np.isnan(result.rounds[1].base_rate)


class Constant(ClassifierMixin, BaseEstimator):
    """Gives the same answer for every row."""

    def __init__(self, answer):
        self.answer = answer

    def fit(self, X, y):
        self.classes_, self.n_learned_ = np.unique(y), len(X)
        return self

    def predict(self, X):
        return np.full(len(X), self.answer)


class Told(LogisticRegression):
    """Writes down the groups of each fit."""

    def fit(self, X, y, groups=None, sample_weight=None):
        self.groups_ = groups
        return super().fit(X, y, sample_weight)


@pytest.mark.parametrize("in_pipeline", [False, True])
def test_whole_plans_are_passed_on_where_fit_takes_them(in_pipeline):
    estimator = make_pipeline(StandardScaler(), Told()) if in_pipeline else Told()
    result = learn(estimator, n_rounds=2, labels="both")
    last = result.estimator[-1] if in_pipeline else result.estimator
    rows = result.transitions.trim_unreliable_runs(1)
    np.testing.assert_array_equal(last.groups_, rows.plan)
    assert result.estimator.validation_accuracy_ > 0.5
    assert not hasattr(estimator, "validation_accuracy_"), "the template stays as it is"


def test_our_classifier_keeps_its_own_accuracy_and_follows_the_seed():
    classifier = TransitionReliabilityClassifier(max_epochs=2)
    results = [learn(classifier, n_rounds=1) for _ in range(2)]
    assert_alike(*results)
    assert classifier.random_state is None
    X, y = results[0].transitions.features(Disc()), results[0].transitions.y
    seeded = clone(classifier).set_params(random_state=results[0].estimator.random_state)
    seeded.fit(X, y, results[0].transitions.plan)
    assert results[0].rounds[-1].p_acc == seeded.validation_accuracy_


def test_scenes_of_a_family_differ_between_rounds():
    result = learn(system=disc_of, n_rounds=2)
    first, second = (np.unique(result.transitions.scene[result.round == i]) for i in range(2))
    assert len(first) > 1
    assert not np.isin(first, second).any()


def disc_of(random_state):
    return Disc(sticky=random_state % 2 == 0)


def test_only_the_first_mistakes_that_end_a_plan_are_learned():
    result = learn(n_rounds=1, labels="plan", n_after=2)
    trimmed = result.transitions.trim_unreliable_runs(2)
    assert result.rounds[0].n_learned == len(trimmed) < len(result.transitions)
    expected = clone(TREE).set_params(random_state=result.estimator.random_state)
    expected.fit(trimmed.features(Disc()), trimmed.y)
    X = result.transitions.features(Disc())
    np.testing.assert_array_equal(expected.predict(X), result.estimator.predict(X))


class Tires(Disc):
    """Carries out two commands of a plan, and all that follow by a fifth."""

    def rollout(self, state, commands):
        slower = np.where(np.arange(len(commands)) < 2, 1.0, 0.2)[:, None]
        return super().rollout(state, commands * slower)


@pytest.mark.parametrize(("system", "n_after"), [(Disc(), 10**6), (Tires(), 1)])
def test_by_default_labels_that_only_say_diverged_are_left_out_where_they_are_most(system, n_after):
    planner = BiasedRRTConnect(None, max_iterations=300)
    sizes = {"n_rounds": 2, "n_plans": N_PLANS, "n_validation": N_VALIDATION}
    result = learn_in_rounds(TREE, planner, system, **sizes, labels="plan", random_state=SEED)
    trimmed = result.transitions.trim_unreliable_runs(n_after)
    assert result.rounds[-1].n_learned == len(trimmed)
    assert (len(trimmed) < len(result.transitions)) == (n_after == 1)


def test_rounds_may_differ_in_how_many_plans_they_make(whole, tmp_path):
    result = learn(n_plans=(N_PLANS, N_PLANS, 12), path=tmp_path)
    assert [report.n_plans for report in result.rounds] == [N_PLANS, N_PLANS, 12]
    assert_equal(result.transitions[result.round < 2], whole.transitions[whole.round < 2])
    last = result.transitions.plan[result.round == 2]
    assert 2 * N_PLANS <= last.min() < last.max() < 2 * N_PLANS + 12
    with pytest.raises(StoreError, match=r"n_plans: .* then, 25 now"):
        learn(path=tmp_path)


def test_the_last_number_of_plans_is_that_of_all_later_rounds(whole, folder, monkeypatch):
    interrupt(monkeypatch, BiasedRRTConnect, "plan", 0)
    assert_alike(learn(n_plans=[N_PLANS, N_PLANS], path=folder), whole)


class Falls(Disc):
    """Can't be executed from some places."""

    def rollout(self, state, commands):
        if state[1] > 0.5:
            raise RuntimeError("fell over")
        return super().rollout(state, commands)


def test_plans_that_fail_are_left_out_where_that_is_asked_for():
    with pytest.raises(PlanFailedError, match="fell over"):
        learn(system=Falls(), n_rounds=1)
    with pytest.warns(UserWarning, match="plans failed and were left out"):
        result = learn(system=Falls(), n_rounds=1, on_error="skip")
    (report,) = result.rounds
    starts = result.transitions.reduced[result.transitions.step == 0]
    assert len(starts) == report.n_solved < report.n_plans == N_PLANS
    assert (starts[:, 1] <= 0.5).all()
    assert report.n_validation == N_VALIDATION


class NoK:
    system = random_state = None

    def plan(self, start_reduced, goal):
        raise NotImplementedError


@pytest.mark.parametrize(
    ("parameters", "told"),
    [
        ({"n_rounds": 0}, "n_rounds must be a positive integer, got 0"),
        ({"n_plans": 2.5}, "n_plans must be a positive integer, got 2.5"),
        ({"n_plans": ()}, "n_plans must hold at least one number"),
        ({"n_plans": (3, 0)}, "n_plans must be a positive integer, got 0"),
        ({"n_validation": 0}, "n_validation must be a positive integer, got 0"),
        ({"on_error": "ignore"}, "on_error must be one of raise, skip, got 'ignore'"),
        ({"labels": "all"}, "labels must be one of plan, executed, both, got 'all'"),
        ({"exploring_k": -1}, "exploring_k must be a number between 0 and inf, got -1"),
        ({"n_after": 0}, "n_after must be a positive integer, got 0"),
        ({"estimator": "tree"}, "estimator must be a classifier with the method fit, got 'tree'"),
        ({"estimator": DecisionTreeClassifier}, "estimator must be a classifier"),
        ({"system": 3}, "system must be a System, a sequence"),
        ({"system": Disc(sticky=False), "n_rounds": 1}, "All .* transitions have the label 1"),
        ({"n_plans": 3, "n_rounds": 1, "random_state": 4}, "n_plans is too small"),
    ],
)
def test_unfit_arguments_are_named(parameters, told):
    with pytest.raises(ValueError, match=told):
        learn(**parameters)


def test_planners_that_can_not_be_given_an_estimator_are_refused():
    with pytest.raises(ValueError, match="planner must have the parameters estimator and k"):
        learn_in_rounds(TREE, NoK(), Disc(), n_rounds=1, n_plans=1)


def test_a_damaged_round_is_named(whole, folder, tmp_path):
    shutil.copytree(folder, tmp_path / "copy")
    file = tmp_path / "copy" / "round-1.item"
    file.write_bytes(file.read_bytes()[:-1])
    with pytest.raises(StoreError, match=r"round-1\.item is damaged"):
        learn(path=tmp_path / "copy")


def test_progress_is_told(whole, folder, capsys):
    learn(path=folder, verbose=1)
    printed = capsys.readouterr()
    assert [f"Round {number}:" in printed.err for number in range(3)] == [True] * 3
    assert "25/25" in printed.err
