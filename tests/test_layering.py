"""The packages, and the rooms inside them, keep to their order."""

import ast
import graphlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# Each package knows only those before it.
ROAD = ("systems", "reliability", "planners")
# Training also learns from mirror images of the rope's features, and the depth of contacts is
# measured inside the rope's engines: nobody else needs either yet.
INSIDERS = {ROOT / "benchmarks" / "rope" / name for name in ("training.py", "penetration.py")}
SYSTEMS = ("planar_arm", "car", "rope")


def module_of(file):
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = {module_of(file): file for package in ROAD for file in (ROOT / package).rglob("*.py")}


def is_for_types_only(node):
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def import_statements(node):
    """Yield all that run, wherever they stand: an import inside a function is an arrow as well."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child
        elif not is_for_types_only(child):
            yield from import_statements(child)


def imported_modules(file):
    for node in import_statements(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
            continue
        assert node.level == 0, f"{file} imports relatively"
        for alias in node.names:
            inner = f"{node.module}.{alias.name}"
            yield inner if inner in FILES else node.module


ARROWS = {module: set(imported_modules(file)) for module, file in FILES.items()}


def room_of(module):
    """Name the folder of a module two or more below its package's, else the module itself."""
    package, *rest = module.split(".")
    folders = [package, *rest[:-1]]
    return ".".join(folders) if len(folders) > 2 or (package != "systems" and rest[1:]) else module


def assert_no_circle(graph):
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        pytest.fail(f"These import one another: {' <- '.join(error.args[1])}")


@pytest.mark.parametrize("package", ROAD)
def test_no_import_runs_back_up_the_road(package):
    later = {*ROAD[ROAD.index(package) + 1 :], "benchmarks", "examples", "tests"}
    for module, imported in ARROWS.items():
        if module.split(".")[0] == package:
            assert not later & {name.split(".")[0] for name in imported}, module


def test_no_modules_import_one_another():
    inner = {module: imported & set(FILES) for module, imported in ARROWS.items()}
    assert len(inner) > 50
    assert_no_circle(inner)


def test_no_rooms_import_one_another():
    """Such as obstacles, which scenes are made of, importing a scene."""
    graph = {}
    for module, imported in ARROWS.items():
        rooms = {room_of(name) for name in imported & set(FILES)}
        graph.setdefault(room_of(module), set()).update(rooms - {room_of(module)})
    assert "systems.rope.obstacles" in graph["systems.rope.scene"], "a room, and a file beside it"
    assert_no_circle(graph)


def test_systems_know_only_what_all_systems_share():
    for module, imported in ARROWS.items():
        for name in imported:
            ours, theirs = (f"{m}..".split(".")[1] for m in (module, name))
            if name.startswith("systems.") and theirs in SYSTEMS:
                assert ours == theirs or not module.startswith("systems."), f"{module}: {name}"


@pytest.mark.parametrize("folder", ["benchmarks", "examples"])
def test_experiments_and_examples_import_public_names_only(folder):
    files = set((ROOT / folder).rglob("*.py"))
    assert files
    for file in files - INSIDERS:
        for name in imported_modules(file):
            package, *rest = name.split(".")
            assert package not in ROAD or not rest, f"{file.relative_to(ROOT)} imports {name}"
