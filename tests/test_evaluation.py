"""Evaluations: unseen problems in order, counted with intervals, the same however it is run."""

import copy
import json
from dataclasses import replace

import joblib
import numpy as np
import pytest
from executed_toys import Fragile, Peg, Point, Slow, Straight
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binomtest
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import roc_auc_score
from toy_systems import Disc

from planners import (
    BiasedRRTConnect,
    Evaluation,
    ExecutionStatus,
    Share,
    SuccessCalibration,
    evaluate,
    execute,
)
from reliability import PlanFailedError, StoreError, collect_transitions
from systems import Problem, SimulationDivergedError

N = 30


def assess(system, planner=None, n_problems=N, **parameters):
    planner = Straight() if planner is None else planner
    return evaluate(
        system, planner, n_problems, **{"tolerance": 0.1, "random_state": 3} | parameters
    )


def outcomes(evaluation):
    """Return all but times, which are never the same."""
    problems = evaluation.to_dict()["problems"]
    return [{k: v for k, v in one.items() if k != "planning_time"} for one in problems]


@pytest.fixture(scope="module")
def of_disc():
    return assess(Disc(), BiasedRRTConnect(None))


class Noting(Straight):
    """Writes down the problems that it is given."""

    problems: tuple = ()

    def plan(self, start_reduced, goal):
        Noting.problems += ((start_reduced, goal[0], self.random_state),)
        return super().plan(start_reduced, goal)


def noted(function, *arguments, **parameters):
    Noting.problems = ()
    function(*arguments, random_state=3, **parameters)
    return Noting.problems


def test_counts_are_those_of_the_executions(of_disc):
    disc = Disc()
    problems = noted(evaluate, disc, Noting(), N, tolerance=0.1)
    for i, (start, goal, seed) in enumerate(problems):
        planner = BiasedRRTConnect(disc, random_state=seed)
        plan = planner.plan(start, goal)
        rollout = disc.rollout(start, plan.commands)
        succeeded = plan.success and disc.succeeded(rollout.states[-1], goal[None], 0.1)
        assert of_disc.succeeded[i] == succeeded
        assert of_disc.solved[i] == plan.success
        assert of_disc.n_transitions[i] == len(plan.commands)
        assert of_disc.stop_reason[i] == rollout.stop_reason.value
        assert of_disc.success_probability[i] == 1
    assert of_disc.n_problems == N
    assert 0 < of_disc.n_succeeded == of_disc.succeeded.sum() < of_disc.n_solved
    assert (of_disc.planning_time > 0).all()
    assert of_disc.random_state == 3


def test_problems_are_others_than_those_of_a_collection():
    collected = noted(collect_transitions, Point(), Noting(), 40)
    evaluated = noted(evaluate, Point(), Noting(), 40, tolerance=0.1)
    starts = {tuple(start) for start, _, _ in (*collected, *evaluated)}
    seeds = {seed for _, _, seed in (*collected, *evaluated)}
    assert len(starts) == len(seeds) == 80


def test_all_planners_get_the_same_problems_and_fewer_are_the_first():
    first, again = (noted(evaluate, Point(), Noting(), n, tolerance=1.0) for n in (9, 4))
    assert joblib.hash(first[:4]) == joblib.hash(again)


@pytest.mark.parametrize("n_jobs", [2, -1])
def test_outcomes_do_not_depend_on_processes(of_disc, n_jobs):
    assert outcomes(assess(Disc(), BiasedRRTConnect(None), n_jobs=n_jobs)) == outcomes(of_disc)


def test_outcomes_depend_on_the_seed(of_disc):
    assert outcomes(assess(Disc(), BiasedRRTConnect(None), random_state=4)) != outcomes(of_disc)


class Places:
    """Makes a system of a number."""

    def __init__(self):
        self.seeds = []

    def __call__(self, random_state):
        self.seeds.append(random_state)
        return Slow() if random_state % 2 else Point()


def test_scenes_of_a_sequence_take_turns():
    evaluation = assess([Point(), Slow()], n_problems=6)
    assert evaluation.scene.tolist() == [0, 1] * 3
    assert evaluation.succeeded.tolist() == [True, False] * 3


def test_scenes_of_a_callable_are_new_ones():
    places = Places()
    evaluation = assess(places, n_problems=8)
    assert evaluation.scene.tolist() == places.seeds
    assert len(set(places.seeds)) == 8
    assert evaluation.succeeded.tolist() == [seed % 2 == 0 for seed in places.seeds]
    collected = collect_transitions(Places(), Straight(), 8, random_state=3)
    assert not set(collected.scene) & set(places.seeds)


def test_closed_loop_is_the_same_as_executing_each(of_disc):
    closed = assess(Disc(), BiasedRRTConnect(None), max_replans=5)
    assert closed.max_replans == 5
    assert closed.n_succeeded > of_disc.n_succeeded
    assert set(closed.n_replans) > {0}
    start, goal, seed = noted(evaluate, Disc(), Noting(), 1, tolerance=0.1)[0]
    planner = BiasedRRTConnect(None, random_state=seed)
    problem = Problem(start, goal[None])
    execution = execute(Disc(), planner, problem, tolerance=0.1, max_replans=5)
    assert closed.status[0] is execution.status
    assert closed.n_replans[0] == execution.n_replans


def test_a_folder_keeps_what_is_done_and_can_be_extended(of_disc, tmp_path):
    planner = BiasedRRTConnect(None)
    part = assess(Disc(), planner, 10, path=tmp_path)
    assert outcomes(part) == outcomes(of_disc)[:10]
    kept = {file.name: file.read_bytes() for file in tmp_path.glob("problem-*")}
    whole = assess(Disc(), planner, path=tmp_path, n_jobs=2, random_state=None)
    assert outcomes(whole) == outcomes(of_disc), "and the folder's seed is taken"
    assert all((tmp_path / name).read_bytes() == content for name, content in kept.items())
    np.testing.assert_array_equal(whole.planning_time[:10], part.planning_time)
    for parameters, named in (
        ({"tolerance": 0.2}, "tolerance: 0.1 then, 0.2 now"),
        ({"max_replans": 1}, "max_replans: 0 then, 1 now"),
        ({"random_state": 4}, "random_state: 3 then, 4 now"),
    ):
        with pytest.raises(StoreError, match=named):
            assess(Disc(), planner, path=tmp_path, **parameters)


def test_a_collections_folder_is_refused(tmp_path):
    collect_transitions(Disc(), BiasedRRTConnect(None), 3, random_state=3, path=tmp_path)
    with pytest.raises(StoreError, match="transitions of executed plans"):
        assess(Disc(), BiasedRRTConnect(None), path=tmp_path)


def test_a_simulator_that_diverges_is_a_failure_of_its_own():
    evaluation = assess(Fragile(), tolerance=10.0)
    diverged = np.array([s is ExecutionStatus.SIMULATION_DIVERGED for s in evaluation.status])
    assert 0 < diverged.sum() < N
    np.testing.assert_array_equal(evaluation.succeeded, ~diverged)
    assert f"{diverged.sum():5d}  SIMULATION_DIVERGED: The simulator diverged" in str(evaluation)
    assert evaluation.stop_reason[np.argmax(diverged)] is None


class Breaks(Straight):
    def plan(self, start_reduced, goal):
        if start_reduced[0] > 0.5:
            raise ZeroDivisionError("no way")
        return super().plan(start_reduced, goal)


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_a_planner_that_raises_ends_with_the_problem(n_jobs):
    problems = noted(evaluate, Point(), Noting(), N, tolerance=0.1)
    number = next(i for i, problem in enumerate(problems) if problem[0][0] > 0.5)
    with pytest.raises(PlanFailedError) as caught:
        assess(Point(), Breaks(), n_jobs=n_jobs)
    facts = caught.value.facts
    if n_jobs == 1:
        assert facts["plan"] == number
    start, _, seed = problems[facts["plan"]]
    assert facts["random_state"] == seed
    assert repr(start) in facts["problem"]
    assert isinstance(caught.value.__cause__, ZeroDivisionError)
    assert f"random_state of the planner {seed}) failed with ZeroDivisionError" in str(caught.value)


def test_a_problem_that_can_not_be_drawn_is_told():
    class Shy(Point):
        def sample_problem(self, random_state=None):
            raise SimulationDivergedError("not here")

    with pytest.raises(PlanFailedError, match="Its problem: not drawn yet"):
        assess(Shy())


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"n_problems": 0}, "n_problems must be a positive integer, got 0"),
        ({"tolerance": -0.1}, "tolerance must be a number between 0"),
        ({"max_replans": -1}, "max_replans must be an integer of at least 0"),
        ({"system": "arm"}, "system must be a System, a sequence"),
        ({"system": []}, "system must be a sequence of at least one System"),
        ({"planner": BiasedRRTConnect(Disc())}, "planner has the system"),
        ({"random_state": -1}, "random_state must not be negative"),
    ],
)
def test_bad_arguments_are_refused(parameters, message):
    with pytest.raises(ValueError, match=message):
        assess(**{"system": Point()} | parameters)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(1, 500).flatmap(lambda total: st.tuples(st.integers(0, total), st.just(total))))
def test_intervals_are_wilsons(counts):
    n, total = counts
    share, z = Share.of(n, total), 1.959963984540054
    expected = binomtest(n, total).proportion_ci(0.95, "wilson")
    assert (share.low, share.high) == (expected.low, expected.high)
    middle = (n + z**2 / 2) / (total + z**2)
    half = z * np.sqrt(n * (total - n) / total + z**2 / 4) / (total + z**2)
    np.testing.assert_allclose([share.low, share.high], [middle - half, middle + half], atol=1e-9)


def test_shares_in_words():
    assert str(Share.of(42, 60)) == "42 of 60, 70.0% (57.5% to 80.1%)"
    assert str(Share.of(0, 0)) == "0 of 0"


def made_of(succeeded, probability, solved=None, seed=0):
    n = len(succeeded)
    solved = [True] * n if solved is None else solved
    return Evaluation.of(
        [
            {
                "scene": 0,
                "solved": solved[i],
                "status": "REACHED" if succeeded[i] else "LEFT_PLAN",
                "stop_reason": "Every command was carried out.",
                "planning_time": [0.125, 0.25, 1.0, 0.25][i % 4],
                "n_transitions": 10 + i,
                "n_replans": 0,
                "success_probability": probability[i],
            }
            for i in range(n)
        ],
        0.1,
        0,
        seed,
    )


def test_auc_of_success():
    succeeded, probability = [1, 0, 1, 0, 1, 0], [0.9, 0.8, 0.7, 0.2, 0.6, 0.0]
    of_all = made_of(succeeded, probability)
    assert of_all.success_auc == roc_auc_score(succeeded, probability)
    unsolved = made_of(succeeded, probability, [True] * 5 + [False])
    assert unsolved.success_auc == roc_auc_score(succeeded[:5], probability[:5])
    assert np.isnan(made_of([1, 1], [0.2, 0.3]).success_auc)
    assert np.isnan(made_of([1, 0], [1.0, 1.0]).success_auc)
    assert np.isnan(made_of([1, 0], [np.nan, 1.0]).success_auc)


def test_the_table_and_the_dictionary():
    evaluation = made_of([1, 0, 1, 0], [0.9, 0.1, 0.7, 0.2])
    found = json.loads(json.dumps(evaluation.to_dict()))
    assert found["succeeded"]["n"] == 2
    assert found["solved"]["total"] == 4
    assert found["planning_time"] == {"median": 0.25, "mean": 0.40625}
    assert found["n_transitions"]["median"] == 11.5
    assert found["success_auc"] == 1
    assert found["status"] == {"REACHED": 2, "LEFT_PLAN": 2}
    assert found["stop_reason"] == {"Every command was carried out.": 4}
    assert [one["succeeded"] for one in found["problems"]] == [True, False, True, False]
    table = str(evaluation)
    for part in (
        "executed successes   2 of 4, 50.0%",
        "0.25 s in the median, 0.406 s in the mean",
        "AUC of success 1.00",
        "    2  LEFT_PLAN: The system left its plan",
        "    4  Every command was carried out.",
    ):
        assert part in table


def test_nothing_solved_is_still_a_table():
    evaluation = assess(Point(), Straight(n_plans=0), 3)
    assert evaluation.n_solved == evaluation.n_succeeded == 0
    assert "solved               0 of 3" in str(evaluation)
    assert evaluation.to_dict()["n_transitions"] == {"median": None, "mean": None}
    assert "3  NO_PLAN" in str(evaluation)


def test_planners_are_compared_problem_by_problem():
    first = made_of([1, 0, 1, 0, 0, 0, 0], np.linspace(0, 1, 7))
    second = made_of([0, 1, 1, 1, 1, 1, 1], np.ones(7))
    comparison = Evaluation.compare({"none": first, "ours": second})
    assert comparison.differing("ours") == (5, 1, binomtest(5, 6).pvalue)
    assert comparison.differing("none") == (0, 0, 1.0)
    lines = str(comparison).splitlines()
    assert lines[2].split()[:3] == ["none", "7", "2"]
    assert lines[3].split()[:3] == ["ours", "7", "6"]
    assert "5 : 1  (p = 0.22)" in lines[3]
    assert json.loads(json.dumps(comparison.to_dict()))["ours"]["against_first"]["only_this"] == 5


def test_only_the_same_problems_are_compared():
    one = made_of([1, 0], [1.0, 1.0])
    finer = replace(one, tolerance=0.01)
    for other in (made_of([1, 0], [1.0, 1.0], seed=1), made_of([1], [1.0]), finer):
        with pytest.raises(ValueError, match="must be of the same problems: 'ours' has"):
            Evaluation.compare({"none": one, "ours": other})
    with pytest.raises(ValueError, match="at least one"):
        Evaluation.compare({})


def test_plots_show_counts_and_shares():
    pyplot = pytest.importorskip("matplotlib.pyplot")
    rng = np.random.default_rng(0)
    probability = rng.random(40)
    evaluation = made_of(rng.random(40) < probability, probability)
    axes = evaluation.plot()
    assert [bar.get_width() for bar in axes[0].patches] == [
        n for _, n in sorted(evaluation.to_dict()["status"].items(), key=lambda kv: -kv[1])
    ]
    assert [text.get_text() for text in axes[1].texts] == ["8"] * 5
    axis = Evaluation.compare({"none": evaluation, "ours": evaluation}).plot()
    assert [label.get_text() for label in axis.get_yticklabels()] == ["none", "ours"]
    pyplot.close("all")


def test_verbose_tells_the_table(capsys):
    evaluation = assess(Point(), n_problems=3, verbose=1)
    assert str(evaluation) in capsys.readouterr().err


def test_an_estimators_planner_is_evaluated_too(disc_data):
    X, y, _ = disc_data
    planner = BiasedRRTConnect(None, LogisticRegression().fit(X, y), accuracy=0.9)
    evaluation = assess(Disc(), planner, 10, max_replans=2)
    assert ((evaluation.success_probability > 0) & (evaluation.success_probability < 1)).all()
    assert assess(Peg(), BiasedRRTConnect(None), 3).n_solved == 3


# Plans, for SuccessCalibration to learn from


@pytest.fixture(scope="module")
def judging_planner():
    X = np.random.default_rng(0).uniform(
        -1, 1, (40, Disc().features(*np.zeros((2, 1, 2))).shape[1])
    )
    return BiasedRRTConnect(None, LogisticRegression().fit(X, X[:, 0] > 0), k=0.1, accuracy=0.9)


def test_plans_are_those_that_were_carried_out_also_when_read_again(judging_planner, tmp_path):
    disc = Disc()
    problems = noted(evaluate, disc, Noting(), 6, tolerance=0.1)
    for _ in range(2):
        evaluation = assess(disc, judging_planner, 6, path=tmp_path / "kept")
        for (start, goal, seed), kept in zip(problems, evaluation.plans, strict=True):
            planner = copy.copy(judging_planner).set_params(system=disc, random_state=seed)
            plan = planner.plan(start, goal)
            for name in ("reduced", "commands", "reliability"):
                np.testing.assert_array_equal(getattr(kept, name), getattr(plan, name))
            assert kept.status is plan.status
            assert (kept.n_checked, kept.random_state) == (plan.n_checked, seed)
            assert kept.success_probability == plan.success_probability


def test_a_calibration_learns_from_an_evaluation(judging_planner):
    evaluation = assess(Disc(), copy.copy(judging_planner).set_params(max_iterations=8))
    plans, succeeded = evaluation.executed_plans
    assert len(plans) == len(succeeded) == evaluation.n_solved < evaluation.n_problems
    assert sum(succeeded) == evaluation.n_succeeded
    calibration = SuccessCalibration().fit(plans, succeeded)
    assert calibration.predict_proba(evaluation.plans).shape == (N, 2)


def test_plans_that_were_replanned_are_no_plans_to_learn_from():
    with pytest.raises(ValueError, match="max_replans is 1"):
        _ = assess(Point(), max_replans=1, n_problems=2).executed_plans
    assert assess(Point(), n_problems=2).plans == [None, None], "toys have plans of their own"
