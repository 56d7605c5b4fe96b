"""Planners and executions with odd arguments."""

from __future__ import annotations

import contextlib
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fuzzing import (
    Door,
    cases,
    choices,
    counts,
    numbers,
    rows,
    st,
    try_numpy_numbers,
    try_odd_values,
)
from matplotlib.figure import Figure
from sklearn.linear_model import LogisticRegression
from toy_systems import Disc

from planners import (
    BiasedRRT,
    BiasedRRTConnect,
    CheckTransition,
    EdgeChecker,
    Evaluation,
    PlanResult,
    Share,
    SuccessCalibration,
    best_of_restarts,
    evaluate,
    execute,
    split_edges,
)
from systems import GoalRegion, Problem

DISC = Disc()
START, GOAL = np.array([-0.9, 0.0]), np.array([[-0.6, 0.3]])
X = np.random.default_rng(0).normal(size=(40, 4))
ESTIMATOR = LogisticRegression().fit(X, X[:, 0] < 1)
PLANNER = BiasedRRTConnect(DISC, ESTIMATOR, accuracy=0.9, k=9, random_state=0)
PLANS = [PLANNER.set_params(random_state=i).plan(START, GOAL) for i in range(4)]
OUTCOMES = [True, False, True, True]
CALIBRATION = SuccessCalibration().fit(PLANS, OUTCOMES)
PARAMETERS = {
    "system": DISC,
    "estimator": ESTIMATOR,
    "k": 9.0,
    "accuracy": 0.875,
    "acceptance": "fixed",
    "simplify": True,
    "max_iterations": 200,
    "time_limit": 50.0,
    "calibration": CALIBRATION,
    "min_success": 0.0,
    "restarts": 1,
    "random_state": 1,
}


def planned(planner_class, **given):
    problem = {"start_reduced": START, "goal": GOAL}
    for name in problem.keys() & given.keys():
        problem[name] = given.pop(name)
    plan = planner_class(**given).plan(**problem)
    return plan.reduced, plan.commands, plan.reliability


def planner_door(planner_class, more=()):
    parameters = {**PARAMETERS, **dict(more), "start_reduced": START, "goal": GOAL}
    odd = dict.fromkeys(parameters, numbers)
    odd.update(dict.fromkeys(["system", "estimator", "acceptance", "calibration"], choices))
    # With a large number of them, plans are made until one is certain to succeed.
    odd.update(simplify=choices, restarts=counts, start_reduced=rows(2), goal=rows(1, 2))
    return Door(
        lambda **given: planned(planner_class, **given), lambda: dict(parameters), odd, share=0.6
    )


def executed(**given):
    problem = Problem(given.pop("start"), given.pop("goal")) if "start" in given else None
    return execute(**{"problem": problem, **given}).commands


def checked(**given):
    rows_of = {name: given.pop(name) for name in ("reduced", "next_reduced")}
    return CheckTransition(**given).evaluate(**rows_of)


def edges(**given):
    check = CheckTransition(DISC, None, k=1.0, accuracy=0.9, rng=np.random.default_rng(0))
    return EdgeChecker(DISC, check).evaluate(**given)


def kept(**given):
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "plan.npz"
        replace(PLANS[0], **given).save(file)
        return PlanResult.load(file).reduced


EVALUATED = {
    "system": DISC,
    "planner": BiasedRRTConnect(DISC, max_iterations=50),
    "n_problems": 1,
    "tolerance": 0.5,
    "max_replans": 1,
    "random_state": 0,
}
EVALUATION = evaluate(**{**EVALUATED, "n_problems": 4})
DRAWN_ON = Figure().subplots(1, 2)
paths = choices | st.sampled_from(["file", ".", "file/inside", "new/folder/deep", "\0", "a" * 300])
PAIR = np.array([[-0.9, 0.0], [-0.6, 0.3]])
few = st.sampled_from(
    [[], [1], [None], PLANS[:1], PLANS[0], "ab", {}, None, 3, [replace(PLANS[0], reliability=None)]]
)


class Region(GoalRegion):
    """Goals that are drawn, and their distances, as they are given."""

    def __init__(self, sampled, distance):
        self.sampled, self.distance_given = sampled, distance

    def sample(self, rng, n):
        return self.sampled

    def distance(self, configurations):
        return self.distance_given


def reached(sampled, distance):
    region = Region(sampled, distance)
    plan = PLANNER.set_params(random_state=0, max_iterations=200).plan(START, region)
    problem = Problem(START, region)
    ended = execute(DISC, EVALUATED["planner"], problem, tolerance=0.5)
    return plan.reduced, ended.commands


def in_ompl(space_information, start_reduced):
    return PLANNER.ompl_planner(space_information, start_reduced).getName()


def kept_in(function):
    def call(path):
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            Path("file").write_bytes(b"")
            function(path)

    return call


def space_information():
    from ompl import base

    space = base.RealVectorStateSpace(2)
    space.setBounds(-1, 1)
    return base.SpaceInformation(space)


DOORS = {
    "GoalRegion": Door(
        reached,
        lambda: {"sampled": GOAL.copy(), "distance": np.zeros(1)},
        {"sampled": rows(1, 2), "distance": rows(1)},
        names={"sampled": "(sample|goal)", "distance": "(distance|goal)"},
        share=0.4,
    ),
    "ompl_planner": Door(
        in_ompl,
        lambda: {"space_information": space_information(), "start_reduced": START},
        {"space_information": choices, "start_reduced": rows(2)},
    ),
    "evaluate (path)": Door(
        kept_in(lambda path: evaluate(**EVALUATED, path=path)),
        lambda: {"path": "folder"},
        {"path": paths},
        errors=(ValueError, OSError),
        share=0.2,
        names={"path": "(path|folder)"},
    ),
    "PlanResult.save (path)": Door(
        kept_in(PLANS[0].save), lambda: {"path": "file"}, {"path": paths}, (ValueError, OSError)
    ),
    "Evaluation.plot": Door(
        lambda **given: str(EVALUATION.plot(**given)),
        lambda: {"axes": DRAWN_ON},
        {"axes": choices},
        share=0.4,
    ),
    "Evaluation.compare": Door(
        lambda **given: str(Evaluation.compare(**given)),
        lambda: {"evaluations": {"a": EVALUATION, "b": EVALUATION}},
        {"evaluations": choices | st.sampled_from([{"a": 1}, {"a": None, "b": 2}, [1]])},
    ),
    "Comparison.plot": Door(
        lambda **given: str(Evaluation.compare({"a": EVALUATION}).plot(**given)),
        lambda: {"axis": DRAWN_ON[0]},
        {"axis": choices},
        share=0.4,
    ),
    "BiasedRRT": planner_door(BiasedRRT),
    "BiasedRRTConnect": planner_door(BiasedRRTConnect, {"transitions_per_edge": 5}.items()),
    "execute": Door(
        executed,
        lambda: {
            "system": DISC,
            "planner": EVALUATED["planner"],
            "start": START,
            "goal": GOAL,
            "tolerance": 0.5,
            "max_replans": 1,
        },
        {
            "system": choices,
            "planner": choices,
            "goal": rows(1, 2),
            "tolerance": numbers,
            "max_replans": numbers,
        },
    ),
    "execute (problem)": Door(
        executed,
        lambda: {
            "system": DISC,
            "planner": EVALUATED["planner"],
            "problem": Problem(START, GOAL),
            "tolerance": 0.5,
        },
        {"problem": choices},
    ),
    "evaluate": Door(
        lambda **given: evaluate(**given).to_dict(),
        lambda: dict(EVALUATED),
        {
            "system": choices,
            "planner": choices,
            "n_problems": counts,
            "tolerance": numbers,
            "max_replans": numbers,
            "random_state": numbers,
        },
        share=0.4,
    ),
    "CheckTransition": Door(
        checked,
        lambda: {
            "system": DISC,
            "estimator": ESTIMATOR,
            "k": 2.0,
            "accuracy": 0.875,
            "rng": np.random.default_rng(0),
            "acceptance": "fixed",
            "reduced": PAIR,
            "next_reduced": PAIR,
        },
        {
            "estimator": choices,
            "k": numbers,
            "accuracy": numbers,
            "acceptance": choices,
        },
    ),
    "best_of_restarts": Door(
        best_of_restarts,
        lambda: {"attempt": lambda number: PLANS[number % 4], "n_plans": 2, "enough": 0.5},
        {"n_plans": counts, "enough": numbers},
    ),
    "SuccessCalibration.fit": Door(
        lambda **given: SuccessCalibration().fit(**given).levels_,
        lambda: {"results": PLANS, "succeeded": OUTCOMES},
        {"results": few, "succeeded": rows(4)},
        names={"results": "(results|succeeded)"},
    ),
    "SuccessCalibration.predict_proba": Door(
        CALIBRATION.predict_proba, lambda: {"results": PLANS}, {"results": few}
    ),
    "SuccessCalibration.min_success_for": Door(
        CALIBRATION.min_success_for,
        lambda: {
            "results": PLANS * 20,
            "succeeded": OUTCOMES * 20,
            "share": 0.5,
            "confidence": 0.5,
        },
        {
            "results": few,
            "succeeded": rows(80),
            "share": numbers,
            "confidence": numbers,
        },
        names={
            "results": "(results|succeeded)",
            "succeeded": "(succeeded|No min_success)",
            "share": "share",
            "confidence": "confidence",
        },
    ),
    "PlanResult.save": Door(
        kept,
        lambda: {
            "reduced": PLANS[0].reduced,
            "commands": PLANS[0].commands,
            "tree": PLANS[0].tree,
            "reliability": PLANS[0].reliability,
            "random_state": 1,
        },
        {
            "reduced": rows(*PLANS[0].reduced.shape),
            "commands": rows(*PLANS[0].commands.shape),
            "tree": rows(1, 2, 2),
            "reliability": rows(len(PLANS[0].commands)),
            "random_state": numbers,
        },
        names={"commands": "(commands|reduced)"},
    ),
    "PlanResult.load": Door(
        PlanResult.load,
        lambda: {"path": "nowhere.npz"},
        {"path": choices},
        errors=(ValueError, OSError),
        names={"path": "(path|whole file)"},
    ),
    "Share.of": Door(
        Share.of, lambda: {"n": 1, "total": 4}, {"n": numbers, "total": numbers}, share=0.5
    ),
    "split_edges": Door(
        split_edges,
        lambda: {"starts": PAIR, "ends": PAIR + 0.1, "step_size": 0.1},
        {"starts": rows(2, 2), "ends": rows(2, 2), "step_size": counts},
    ),
}


@cases(DOORS)
def test_an_odd_argument_gives_a_sane_result_or_an_error_that_names_it(name, argument):
    try_odd_values(DOORS, name, argument)


@pytest.mark.parametrize("name", [name for name in DOORS if name != "PlanResult.load"])
def test_numpy_scalars_are_numbers(name):
    try_numpy_numbers(DOORS[name])
