"""The examples run as a user runs them: as files, from another folder; fewer plans save time."""

import os
import re
import subprocess
import sys
from pathlib import Path

import matplotlib.image
import pytest

ROOT = Path(__file__).parents[1]
FILES = sorted((ROOT / "examples").glob("*.py"))
# Constants of a file that are smaller here, and what the file then prints, in this order.
RUNS = {
    "quickstart.py": (
        {"N_PLANS": "120"},
        [r"transitions, held-out accuracy \d\d%", r"without .* stand\? False", "stand\\? True"],
    ),
    "any_estimator.py": (
        {"N_PLANS": "40", "N_PROBLEMS": "3"},
        [r"no classifier +3 ", r"logistic regression +\d\d", r"calibrated network +\d\d"],
    ),
    "held_out_plans.py": (
        {"N_PLANS": "40"},
        [r"split by rows: \d\d", r"trees, split by plans: \d\d", r"network, split by plans: \d\d"],
    ),
    "own_system.py": ({}, [r"without .* ends at \[1\.\d+ +3", r"with .* ends at \[0\.5 +3"]),
    "own_simulator.py": ({}, [r"\d+ transitions, [1-9]\d% of them Unreliable"]),
    "own_scene.py": (
        {"N_PLANS, N_TESTS": "24, 2"},
        ["are Unreliable", "Without .* 0 of 2", r"With .* \d of 2"],
    ),
    "arm.py": (
        {"N_PLANS": "150", "N_TESTS": "3"},
        ["of them Unreliable", r"Without .* in \d of 3", r"With .* in [23] of 3"],
    ),
    "car.py": (
        {"N_PLANS, N_TESTS": "(200, 40), 3"},
        [r"Kept: the estimator of round \d", r"Without .* in [01] of 3", r"With .* in \d of 3"],
    ),
    "rope_shapes.py": ({}, ["The system is within the tolerance of the goal"]),
    "rope.py": ({}, [r"Without .* gets caught.*stretch", "With .* passes. Every command was"]),
}
PICTURES = {"own_scene.py", "arm.py", "car.py", "rope.py", "rope_shapes.py"}


def shrunk(code, constants):
    for name, value in constants.items():
        code, n = re.subn(rf"^{re.escape(name)} = .*$", f"{name} = {value}", code, flags=re.M)
        assert n == 1, f"{name} must be a constant of the module"
    return code


def test_every_example_is_run():
    assert {file.name for file in FILES} == set(RUNS)


@pytest.mark.parametrize("name", RUNS)
def test_the_example_runs_anywhere(name, tmp_path):
    constants, expected = RUNS[name]
    # A file of the same depth, so that the example finds what it refers to.
    folder = tmp_path / "examples"
    folder.mkdir()
    (tmp_path / "benchmarks").symlink_to(ROOT / "benchmarks")
    code = (ROOT / "examples" / name).read_text()
    (folder / name).write_text(shrunk(code, constants))
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    # Threads of OpenMP wait for one another by spinning, for minutes where cores are busy.
    settings = {"PYTHONPATH": str(ROOT), "MPLBACKEND": "agg", "OMP_NUM_THREADS": "1"}
    run = subprocess.run(
        [sys.executable, folder / name],
        cwd=elsewhere,
        env=os.environ | settings,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert re.search(".*".join(expected), run.stdout, flags=re.S), run.stdout
    picture = elsewhere / f"{Path(name).stem}.png"
    assert list(elsewhere.iterdir()) == ([picture] if name in PICTURES else [])
    if name in PICTURES:
        pixels = matplotlib.image.imread(picture)
        assert min(pixels.shape[:2]) > 300
        assert pixels[..., :3].std() > 0.05, "not blank"


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_an_example_is_first_code(file):
    code = file.read_text()
    assert len([line for line in code.splitlines() if line]) <= 60
    assert not re.search(r"argparse|sys\.path|^(from|import) (benchmarks|examples)", code, re.M)
    assert code.startswith('"""'), "says what it shows"
