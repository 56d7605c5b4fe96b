"""The three packages: their public names, and what importing them costs."""

import importlib
import pydoc
import re
import subprocess
import sys

import pytest

PACKAGES = ("systems", "reliability", "planners")


@pytest.mark.parametrize("name", PACKAGES)
def test_help_and_dir_show_every_public_name(name):
    package = importlib.import_module(name)
    text = pydoc.render_doc(package, renderer=pydoc.plaintext)
    # A heading each, such as "class Rope(System)", "load_scene(name)" or "SCENE_NAMES = (…)".
    headed = set(re.findall(r"^    (?:class )?(\w+)(?:\(| = |$)", text, flags=re.M))
    contents = re.search(r"^PACKAGE CONTENTS\n(.*?)\n\n", text, flags=re.M | re.S)[1]
    assert len(package.__all__) >= 6
    assert set(package.__all__) <= set(dir(package))
    assert set(package.__all__) <= headed - set(contents.split())


@pytest.mark.parametrize("name", PACKAGES)
def test_every_public_name_can_be_imported(name):
    package = importlib.import_module(name)
    for public in package.__all__:
        home = getattr(getattr(package, public), "__module__", name)
        assert home.split(".")[0] in {name, "builtins"}
    with pytest.raises(AttributeError, match="no_such_name"):
        package.no_such_name  # noqa: B018


def test_importing_the_packages_imports_nothing_slow():
    slow = {"numpy", "numba", "mujoco", "sklearn", "torch", "ompl", "pybullet"}
    code = f"import {', '.join(PACKAGES)}, sys; print(*{slow} & set(sys.modules))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []
