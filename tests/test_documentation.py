"""What the documentation shows works, and what it mentions exists."""

import doctest
import importlib.util
import inspect
import pydoc
import re
import sys
import types
from enum import Enum
from pathlib import Path

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression
from toy_systems import Disc

import planners
import reliability
import systems
from planners import BiasedRRTConnect
from planners.viewer.arguments import make_show

ROOT = Path(__file__).parents[1]
PACKAGES = (systems, reliability, planners)
PAGES = sorted((ROOT / "docs").glob("*.md"))


@pytest.mark.parametrize(
    "module",
    [
        "reliability.classifier",
        "reliability.diagnosis",
        "reliability.feature_comparison",
        "systems.features.body_frame",
        "systems.features.directions",
        "systems.features.mujoco_obstacles",
        "systems.features.ray_distances",
        "planners.carrying_out",
        "planners.planner_evaluation",
        "planners.rrt",
        "planners.rrt_connect",
        "systems.goal_region",
        "planners.viewer.viewer",
    ],
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


def test_the_page_on_what_did_not_help_can_be_followed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs" / "it_did_not_help.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, flags=re.S)
    assert len(blocks) == 5
    code = "\n".join(blocks)
    for number, fewer in ((" 600,", " 40,"), ("=300", "=20"), (" 200,", " 40,"), (" 100,", " 20,")):
        assert number in code
        code = code.replace(number, fewer)
    system = Disc()
    without = BiasedRRTConnect(system, max_iterations=200)
    data = reliability.collect_transitions(system, without, 40, random_state=0)
    classifier = LogisticRegression().fit(data.features(system), data.y)
    planner = BiasedRRTConnect(system, classifier, accuracy=0.9, k=3.0, max_iterations=200)
    names = {name: value for name, value in locals().items() if name not in ("page", "code")}
    exec(compile(code, "it_did_not_help.md", "exec"), names)
    shown = capsys.readouterr().out
    for part in ("only this : only none succeeds", "base rate (one label", "Round 0:"):
        assert part in shown
    plan = planner.set_params(random_state=0).plan([-0.9, 0.0], [0.9, 0.0])
    assert plan.calibrated_probability is not None


def test_the_viewers_page_draws_the_point_as_written():
    page = (ROOT / "docs" / "viewer.md").read_text()
    first, drawn = re.findall(r"```python\n(.*?)```", page, flags=re.S)
    names = {"planners": planners, "np": np, "WindyPoint": Disc}
    exec(compile(first[: first.index("\nshow(")], "viewer.md", "exec"), names)
    assert names["plan"].solved
    exec(compile(drawn, "viewer.md", "exec"), names)
    point, goal = names["DrawnPoint"](), np.array([[0.9, 0.2]])
    plan = BiasedRRTConnect(point, random_state=0).plan([-0.9, 0.0], goal)
    (panel,) = make_show(point, plan, None, goal, None).panels
    assert len(panel.tree)
    assert len(panel.scene) == len(panel.planned[0]) == 1


@pytest.mark.parametrize(
    "document",
    [
        "README.md",
        "CONTRIBUTING.md",
        "docs/acceptance.md",
        "docs/classifiers.md",
        "docs/execution.md",
        "docs/features.md",
        "docs/it_did_not_help.md",
        "docs/labels.md",
        "docs/messages.md",
        "docs/plan_worth.md",
        "docs/rope_contacts.md",
        "docs/viewer.md",
        "examples/README.md",
    ],
)
def test_what_documents_mention_exists(document):
    text = (ROOT / document).read_text()
    for name in set(re.findall(r"(?<![\w./])(?:systems|reliability|planners)(?:\.\w+)+", text)):
        assert pydoc.locate(name) is not None, name
    for name in set(re.findall(r"\bbenchmarks(?:\.\w+)+", text)):
        assert importlib.util.find_spec(name), name
    for path in set(re.findall(r"\b(?:benchmarks|docs|examples|tests)/[\w/.-]*\w", text)):
        assert (ROOT / path).exists(), path
    verbs = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), flags=re.M)
    assert set(re.findall(r"`make (\w+)`", text)) <= set(verbs)


def test_classes_that_the_readme_mentions_have_what_it_says():
    text = (ROOT / "README.md").read_text()
    public = {name: getattr(package, name) for package in PACKAGES for name in package.__all__}
    found = [pair for pair in re.findall(r"`(\w+)\.(\w+)", text) if pair[0] in public]
    assert found
    for owner, attribute in found:
        assert hasattr(public[owner], attribute), f"{owner}.{attribute}"


PUBLIC = [
    pytest.param(getattr(package, name), id=f"{package.__name__}.{name}")
    for package in PACKAGES
    for name in package.__all__
    if callable(getattr(package, name))
]


@pytest.mark.parametrize("thing", PUBLIC)
def test_every_public_name_documents_what_it_takes(thing):
    docstring = inspect.getdoc(thing) or ""
    assert docstring.splitlines()[0].endswith("."), "a summary of one line"
    if isinstance(thing, type) and ("__init__" not in vars(thing) or issubclass(thing, Enum)):
        return  # what it takes is documented where it comes from
    sections = re.findall(
        r"^(?:Parameters|Attributes)\n-+\n(.*?)(?=\n\n\w|\Z)", docstring, flags=re.M | re.S
    )
    lines = [line for section in sections for line in section.splitlines() if line[:1].strip()]
    documented = {name.lstrip("*") for line in lines for name in line.split(" : ")[0].split(", ")}
    taken = inspect.signature(thing).parameters
    assert set(taken) <= documented


@pytest.mark.parametrize(
    ("library", "allowed"),
    [
        (
            "mujoco",
            {
                "systems/drawing/mujoco_shapes.py",
                "systems/features/holding_load.py",
                "systems/features/mujoco_models.py",
                "systems/features/mujoco_obstacles.py",
                "systems/planar_arm/simulation.py",
                "systems/rope/renderer.py",
                "systems/mujoco_warnings.py",
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
                "reliability/networks/epoch_callback.py",
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
                "reliability/networks/epoch_callback.py",
                "reliability/networks/metrics.py",
                "reliability/networks/progress.py",
                "reliability/networks/training.py",
            },
        ),
        (
            "ompl",
            {"planners/ompl_backend.py", "planners/ompl_globals.py", "planners/ompl_planner.py"},
        ),
        ("viser", {"planners/viewer/stage.py"}),
    ],
)
def test_heavy_libraries_have_one_home(library, allowed):
    pattern = re.compile(rf"^\s*(import|from) {library}\b", flags=re.M)
    files = [file for package in PACKAGES for file in Path(package.__file__).parent.rglob("*.py")]
    homes = {
        file.relative_to(ROOT).as_posix() for file in files if pattern.search(file.read_text())
    }
    assert homes == allowed


@pytest.mark.parametrize("document", ["README.md", *(f"docs/{page.name}" for page in PAGES)])
def test_links_lead_to_files(document):
    for link in re.findall(r"\]\((?!https?:)([^)#]+)", (ROOT / document).read_text()):
        assert ((ROOT / document).parent / link).exists(), link
