"""What is printed, warned of and logged: nothing that was not asked for."""

import ast
import logging
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression
from toy_systems import Disc

from planners import BiasedRRT, BiasedRRTConnect, evaluate, execute
from reliability import (
    TransitionReliabilityClassifier,
    collect_transitions,
    diagnose,
    learn_in_rounds,
)
from systems import PlanarArm, check_system

ROOT = Path(__file__).parents[1]


def test_nothing_is_printed_unasked(capfd, tmp_path):
    system = Disc()
    check_system(system)
    planner = BiasedRRTConnect(system, max_iterations=300)
    data = collect_transitions(system, planner, 20, random_state=0, path=tmp_path / "plans")
    X, y = data.features(system), data.y
    classifier = TransitionReliabilityClassifier(max_epochs=2, random_state=0).fit(X, y)
    diagnose(LogisticRegression(), data, system)
    planner = BiasedRRT(system, classifier, k=10, max_iterations=300, random_state=0)
    problem = system.sample_problem(0)
    execute(system, planner, problem, tolerance=0.1)
    evaluate(system, planner, 2, tolerance=0.1, random_state=0)
    learn_in_rounds(
        LogisticRegression(),
        planner,
        system,
        n_rounds=1,
        n_plans=20,
        n_validation=2,
        random_state=0,
    )
    shown = capfd.readouterr()
    assert (shown.out, shown.err) == ("", "")


def test_nothing_is_printed_but_told():
    """Also where the test above does not come by."""
    for package in ("systems", "reliability", "planners"):
        for file in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.Call):
                    assert ast.unparse(node.func) != "print", f"{file}:{node.lineno} prints"


def collect_a_few(**parameters):
    collect_transitions(Disc(), BiasedRRTConnect(None), 5, random_state=0, **parameters)


def test_what_verbose_asks_for_is_logged_where_the_program_shows_that(caplog, capsys):
    with caplog.at_level(logging.INFO, "transition-reliability"):
        collect_a_few(verbose=1)
        logged = [(one.name, one.levelname) for one in caplog.records]
        assert logged[:1] == [("transition-reliability", "INFO")]
        assert "transitions of 5 plans" in caplog.text
        assert "transitions of 5 plans" not in capsys.readouterr().err
        caplog.clear()
        collect_a_few()
        assert caplog.text == ""


def test_what_verbose_asks_for_is_shown_in_any_case(caplog, capsys):
    collect_a_few(verbose=1)
    assert caplog.text == ""
    shown = capsys.readouterr()
    assert "transitions of 5 plans" in shown.err
    assert shown.out == ""


@pytest.mark.parametrize("kind", [BiasedRRT, BiasedRRTConnect])
def test_planners_tell_how_the_search_goes(kind, capsys, disc_data):
    X, y, _ = disc_data
    estimator = LogisticRegression().fit(X, y)
    planner = kind(Disc(), estimator, k=10, accuracy=0.9, verbose=1, random_state=0)
    plan = planner.plan([-0.9, 0.0], [0.4, 0.3])
    shown = capsys.readouterr()
    lines = shown.err.replace("\r", "\n").splitlines()
    assert shown.out == ""
    assert any(re.search(rf"{kind.__name__}: .*/20000", line) for line in lines), "a bar"
    found, planned = (line for line in lines if re.match(rf"{kind.__name__}: (a|no) ", line))
    assert re.search(
        r"a path of \d+ transitions after \d+ samples .* [\d,]+ transitions checked", found
    )
    assert f"a plan of {len(plan.commands)} transitions" in planned
    assert f"success_probability {plan.success_probability:.2f}" in planned
    quiet = planner.set_params(verbose=0).plan([-0.9, 0.0], [0.4, 0.3])
    assert np.array_equal(quiet.commands, plan.commands)
    assert quiet.n_checked == plan.n_checked
    assert capsys.readouterr() == ("", "")


def test_planners_tell_that_there_is_no_path(capsys):
    planner = BiasedRRT(Disc(), max_iterations=8, verbose=True, random_state=0)
    assert not planner.plan([-0.9, 0.0], [0.9, 0.0]).solved
    assert "BiasedRRT: no path after 8 samples" in capsys.readouterr().err


@pytest.mark.parametrize("verbose", [-1, 0.5, "yes", None])
def test_verbose_of_a_planner_is_a_number(verbose):
    with pytest.raises(ValueError, match="verbose must be 0 or a positive integer, got"):
        BiasedRRT(Disc(), verbose=verbose).plan([-0.9, 0.0], [0.9, 0.0])


def test_loggers_have_one_name(caplog, tmp_path, monkeypatch):
    """MuJoCo's warnings are logged by it, and not written to a file."""
    monkeypatch.chdir(tmp_path)
    PlanarArm().rollout(np.zeros(3), np.zeros((0, 3)))
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"
    )
    state = mujoco.MjData(model)
    state.qvel[:] = 1e12
    with caplog.at_level(logging.INFO):
        mujoco.mj_step(model, state)
    assert [(one.name, one.levelname) for one in caplog.records] == [
        ("transition-reliability", "INFO")
    ]
    assert "QVEL" in caplog.text
    assert list(tmp_path.iterdir()) == []
    for package in ("systems", "reliability", "planners"):
        for file in (ROOT / package).rglob("*.py"):
            for call in ast.walk(ast.parse(file.read_text())):
                if isinstance(call, ast.Call) and ast.unparse(call.func).endswith("getLogger"):
                    assert ast.unparse(call.args[0]) == "'transition-reliability'"


@pytest.mark.parametrize("name", ["PermissiveAcceptanceWarning", "BaseRateWarning"])
def test_the_page_names_what_is_warned_of(name):
    assert name in (ROOT / "docs" / "messages.md").read_text()
