"""What the documentation shows works, and the packages keep to their order."""

import ast
import doctest
import importlib
import re
import sys
import types
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# Each package knows only those before it.
ROAD = ("systems", "reliability", "planners")


@pytest.mark.parametrize(
    "module", ["reliability.classifier", "planners.rrt", "planners.rrt_connect"]
)
def test_docstring_examples_run(module):
    results = doctest.testmod(importlib.import_module(module))
    assert results.attempted > 0
    assert results.failed == 0


def test_the_readmes_example_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    readme = (ROOT / "README.md").read_text()
    code = re.search(r"## How it goes\n\n```python\n(.*?)```", readme, flags=re.S)[1]
    assert "6000" in code
    exec(compile(code.replace("6000", "60"), "README.md", "exec"), {})
    assert "The plan reaches the goal." in capsys.readouterr().out
    assert (tmp_path / "arm.joblib").exists()


def test_the_readmes_own_system_runs_as_written(capsys):
    readme = (ROOT / "README.md").read_text()
    code = re.search(r"## Your own system\n.*?```python\n(.*?)```", readme, flags=re.S)[1]
    system = code[code.index("class ") : code.index("\n\n\n", code.index("class "))]
    assert len(system.splitlines()) < 60
    assert " 1000," in code
    # A class of no module can't be pickled, which check_system demands.
    module = types.ModuleType("own_system")
    sys.modules[module.__name__] = module
    try:
        exec(compile(code.replace(" 1000,", " 150,"), "README.md", "exec"), vars(module))
    finally:
        del sys.modules[module.__name__]
    assert capsys.readouterr().out.count("The plan reaches the goal.") == 2


def test_the_readmes_rope_scene_can_be_learned(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    readme = (ROOT / "README.md").read_text()
    code = re.search(r"and a model of your own:\n\n```python\n(.*?)```", readme, flags=re.S)[1]
    assert "BiasedRRT(rope), 200, n_jobs=-1" in code
    exec(compile(code.replace("200, n_jobs=-1", "8"), "README.md", "exec"), {})
    assert "The plan reaches the goal." in capsys.readouterr().out


@pytest.mark.parametrize("package", ROAD)
def test_no_import_runs_back_up_the_road(package):
    later = set(ROAD[ROAD.index(package) + 1 :])
    for file in (ROOT / package).rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            names = [node.module] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert not later & {str(name).split(".")[0] for name in names}, file


@pytest.mark.parametrize(
    ("library", "allowed"),
    [
        (
            "mujoco",
            {
                "systems/planar_arm/simulation.py",
                "systems/rope/renderer.py",
                "systems/rope/simulation/mujoco_engine.py",
            },
        ),
        ("pybullet", {"systems/rope/simulation/pybullet_engine.py"}),
        (
            "torch",
            {
                "reliability/networks/batches.py",
                "reliability/networks/checkpoint.py",
                "reliability/networks/devices.py",
                "reliability/networks/metrics.py",
                "reliability/networks/mlp_module.py",
                "reliability/networks/module_inference.py",
                "reliability/networks/training.py",
                "reliability/networks/voxel_grids.py",
                "reliability/networks/voxnet_module.py",
            },
        ),
        (
            "skorch",
            {
                "reliability/networks/checkpoint.py",
                "reliability/networks/metrics.py",
                "reliability/networks/progress.py",
                "reliability/networks/training.py",
            },
        ),
        (
            "ompl",
            {"planners/ompl_backend.py", "planners/ompl_globals.py", "planners/ompl_planner.py"},
        ),
    ],
)
def test_heavy_libraries_have_one_home(library, allowed):
    pattern = re.compile(rf"^\s*(import|from) {library}\b", flags=re.M)
    files = [file for package in ROAD for file in (ROOT / package).rglob("*.py")]
    homes = {
        file.relative_to(ROOT).as_posix() for file in files if pattern.search(file.read_text())
    }
    assert homes == allowed
