"""What is printed, warned of and logged: nothing that was not asked for."""

import ast
import logging
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


def test_prints_stand_under_a_condition_on_verbose():
    """Also where the test above does not come by."""
    found = 0
    for package in ("systems", "reliability", "planners"):
        for file in (ROOT / package).rglob("*.py"):
            tree = ast.parse(file.read_text())
            asked = [
                inner
                for node in ast.walk(tree)
                if isinstance(node, ast.If) and ast.unparse(node.test).endswith("verbose")
                for inner in ast.walk(node)
            ]
            for node in ast.walk(tree):
                if isinstance(node, ast.Call) and ast.unparse(node.func) == "print":
                    found += 1
                    assert node in asked, f"{file}:{node.lineno} prints"
    assert found


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
