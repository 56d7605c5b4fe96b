"""What the documentation shows works, and what it mentions exists."""

import doctest
import importlib
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
GENERATED = ("docs/api/", "docs/gallery/")
PAGES = [
    page
    for file in (
        "README.md",
        "CONTRIBUTING.md",
        "examples/README.md",
        *(ROOT / "docs").rglob("*.md"),
    )
    if not (page := (ROOT / file).relative_to(ROOT).as_posix()).startswith(GENERATED)
]
WITH_EXAMPLES = [
    file.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
    for package in PACKAGES
    for file in sorted(Path(package.__file__).parent.rglob("*.py"))
    if "    >>> " in file.read_text()
]


@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_docstring_examples_run(module):
    results = doctest.testmod(importlib.import_module(module))
    assert results.attempted > 0
    assert results.failed == 0


def code_of(page, smaller):
    """Return a page's Python blocks as one program, with smaller numbers in the place of some."""
    code = "\n".join(re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), flags=re.S))
    for number, fewer in smaller.items():
        assert number in code, number
        code = code.replace(number, fewer)
    return compile(code, page, "exec")


def test_the_readmes_example_runs(capsys):
    example = (ROOT / "README.md").read_text().split("## Example")[1].split("```")[1]
    assert len(example.splitlines()) <= 21, "a line says that it is Python"
    smaller = example.removeprefix("python").replace("arm), 300,", "arm), 120,")
    assert "120" in smaller
    exec(compile(smaller, "README.md", "exec"), {})
    assert capsys.readouterr().out.splitlines() == [
        f"The plan reaches the goal. Does it stand? {stands}" for stands in (False, True)
    ]


def test_the_tutorial_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    smaller = {"6000, n_jobs=-1,": "60,", "verbose=1": "verbose=0", "one, 100,": "one, 3,"}
    exec(code_of("docs/tutorial.md", smaller), {})
    shown = capsys.readouterr().out
    for part in ("are Unreliable", "transitions of unseen plans", "The plan reaches", "only with"):
        assert part in shown
    assert (tmp_path / "arm.skops").exists()


def test_the_page_on_own_systems_runs(capsys):
    text = (ROOT / "docs/own_system.md").read_text()
    code, road = re.findall(r"```python\n(.*?)```", text, flags=re.S)
    system = code[code.index("class ") : code.index("\n\n\n", code.index("class "))]
    assert len(system.splitlines()) < 60
    assert " 1000," in code
    # A class of no module can't be pickled, which check_system demands.
    module = types.ModuleType("own_system")
    sys.modules[module.__name__] = module
    try:
        exec(compile(code.replace(" 1000,", " 150,"), "own_system.md", "exec"), vars(module))
    finally:
        del sys.modules[module.__name__]
    shown = capsys.readouterr().out
    assert shown.count("The plan reaches the goal. Does the point mass?") == 2
    # The same calls are run for the page on what did not help.
    compile(road, "own_system.md", "exec")


def test_the_page_on_own_scenes_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(
        code_of(
            "docs/own_scene.md", smaller={"BiasedRRT(rope), 200, n_jobs=-1": "BiasedRRT(rope), 8"}
        ),
        {},
    )
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


@pytest.mark.parametrize("page", PAGES)
def test_what_pages_mention_exists(page):
    text = (ROOT / page).read_text()
    for name in set(re.findall(r"(?<![\w./])(?:systems|reliability|planners)(?:\.\w+)+", text)):
        if not name.endswith((".md", ".py")):
            assert pydoc.locate(name) is not None, name
    for name in set(re.findall(r"\bbenchmarks(?:\.\w+)+", text)):
        assert importlib.util.find_spec(name), name
    for path in set(re.findall(r"(?<![\w/])(?:benchmarks|docs|examples|tests)/[\w/.-]*\w", text)):
        assert (ROOT / path).exists(), path
    verbs = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), flags=re.M)
    assert set(re.findall(r"`make (\w+)`", text)) <= set(verbs)


def test_classes_that_pages_mention_have_what_is_said():
    public = {name: getattr(package, name) for package in PACKAGES for name in package.__all__}
    found = {
        pair
        for page in PAGES
        for pair in re.findall(r"`(\w+)\.(\w+)", (ROOT / page).read_text())
        if pair[0] in public
    }
    assert len(found) > 10
    for owner, attribute in found:
        documented = re.search(rf"^{attribute}\b", inspect.getdoc(public[owner]), flags=re.M)
        assert hasattr(public[owner], attribute) or documented, f"{owner}.{attribute}"


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
