"""What the distribution says of itself, and what its users find in it."""

import configparser
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import reliability
from reliability import load_pretrained
from systems import Rope

ROOT = Path(__file__).parents[1]
PACKAGES = ("systems", "reliability", "planners")
SETUP = configparser.ConfigParser()
SETUP.read(ROOT / "setup.cfg")


@pytest.mark.parametrize("name", ["rope", "rope_paper", "rope_vector"])
def test_a_pretrained_estimator_says_which_features_it_wants(name):
    estimator = load_pretrained(name)
    assert 0.75 < estimator.validation_accuracy_ < 0.95
    assert estimator.provenance_["transitions"] > 100_000
    rope = Rope("simple_hook", features=estimator.provenance_["features"])
    start = rope.reduce(rope.scene_problem().start)[None]
    assert estimator.predict(rope.features(start, start)).tolist() == [1]


@pytest.mark.parametrize("name", ["arm", "", None, "../rope", ["rope"]])
def test_other_names_are_refused_with_those_that_there_are(name):
    with pytest.raises(ValueError, match="name must be one of rope, rope_paper, rope_vector, got"):
        load_pretrained(name)


def test_every_python_that_is_claimed_is_tested():
    classified = re.findall(r"Python :: (3\.\d+)$", SETUP["metadata"]["classifiers"], flags=re.M)
    required = re.fullmatch(r">=3\.(\d+),<3\.(\d+)", SETUP["options"]["python_requires"])
    lowest, above = required.groups()
    assert classified == [f"3.{minor}" for minor in range(int(lowest), int(above))]
    workflow = (ROOT / ".github" / "workflows" / "tests.yml").read_text()
    assert set(re.findall(r'python: "(.*?)"', workflow)) == set(classified)
    makefile = (ROOT / "Makefile").read_text()
    assert re.search(r"for version in (.*?);", makefile)[1].split() == classified


def test_the_citation_is_of_this_version():
    citation = (ROOT / "CITATION.cff").read_text()
    assert re.search(r"^version: (.*)$", citation, flags=re.M)[1] == reliability.__version__
    assert (
        re.search(r"^license: (.*)$", citation, flags=re.M)[1]
        == (SETUP["metadata"]["license_expression"])
    )


@pytest.fixture
def site(tmp_path):
    """A folder with copies of the three packages, as pip lays them."""
    folder = tmp_path / "site"
    unused = shutil.ignore_patterns("__pycache__", "*.skops")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, folder / package, ignore=unused)
    shutil.copy(ROOT / "_transition_reliability.py", folder)
    return folder


def imported(package, *path):
    """Import a package in a process that looks into some folders first."""
    lines = (f"import sys; sys.path[:0] = {list(map(str, path))}", f"import {package}", "print(1)")
    return subprocess.run(
        [sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, cwd=path[-1]
    )


def in_one_line(text):
    return text.strip().splitlines()[-1]


def test_packages_of_our_own_are_fine_wherever_they_lie(site):
    (site / "another-1.0.dist-info").mkdir()
    (site / "another-1.0.dist-info" / "RECORD").write_text("another/__init__.py,,\n")
    assert imported(", ".join(PACKAGES), site).stdout == "1\n"


def test_another_package_in_place_of_ours_is_named(site, tmp_path):
    theirs = tmp_path / "project" / "planners"
    theirs.mkdir(parents=True)
    (theirs / "__init__.py").touch()
    error = in_one_line(imported("reliability", theirs.parent, site).stderr)
    assert error.startswith("ImportError: transition-reliability needs its own package 'planners'")
    assert f"Python finds {theirs}. Rename or move that one" in error


def test_a_users_own_file_in_place_of_a_package_is_named(site, tmp_path):
    (tmp_path / "systems.py").write_text("robot = None\n")
    error = in_one_line(imported("reliability", tmp_path, site).stderr)
    assert f"Python finds {tmp_path / 'systems.py'}" in error


def test_a_missing_package_is_named(site):
    shutil.rmtree(site / "planners")
    done = imported("systems", site)
    # The repository's own copy may be found by an editable installation.
    assert re.search(r"package 'planners' in .* Python finds (none|/.*planners)", done.stderr)


def test_an_overwritten_package_is_noticed(site):
    """As by the distribution "reliability", installed into the same environment later."""
    (site / "reliability" / "__init__.py").write_text('__version__ = "0.9.0"\n')
    error = in_one_line(imported("planners", site).stderr)
    assert "reliability/__init__.py is not that of transition-reliability: another" in error
    assert "uninstall both" in error
    # As when that distribution is uninstalled again.
    (site / "reliability" / "__init__.py").unlink()
    gone = in_one_line(imported("planners", site).stderr)
    # The repository's own copy may be found in its place.
    assert gone == error or "needs its own package 'reliability'" in gone


def test_a_folder_that_another_distribution_shares_is_noticed(site):
    """As the distribution "reliability", installed into the same environment before."""
    facts = site / "reliability-0.9.0.dist-info"
    facts.mkdir()
    (facts / "RECORD").write_text("reliability/Distributions.py,sha256=x,1\n")
    error = in_one_line(imported("systems", site).stderr)
    assert f"reliability-0.9.0 puts files into {site / 'reliability'}" in error
    assert "uninstall both" in error
