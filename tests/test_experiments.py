"""The examples run, at small size, as a user would run them."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import joblib

from benchmarks.acceptance import SETTINGS
from benchmarks.acceptance import main as compare_acceptance

ROOT = Path(__file__).parents[1]


def run(*command, cwd):
    return completed(*command, cwd=cwd).stdout


def completed(*command, cwd):
    return subprocess.run(
        [sys.executable, *map(str, command)],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=1200,
        check=True,
    )


def test_arm_example_gives_its_table_and_pictures(tmp_path):
    script = "-m", "benchmarks.arm"
    options = ("--plans", 60, "--queries", 4, "--jobs", 2, "--out", tmp_path / "out")
    shown = run(*script, *options, cwd=tmp_path)
    assert "Held-out accuracy" in shown
    assert "From hanging to standing" in shown
    assert "Starts at which the arm can rest: successes out of 4" in shown
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    planners = results["Starts at which the arm can rest"]
    assert list(planners) == ["none", "none, holdable goals", "literal", "ours"]
    assert all(len(records) == 4 for records in planners.values())
    for name in ("arm.joblib", "motions.png", "success.png"):
        assert (tmp_path / "out" / name).stat().st_size > 10_000
    again = run(*script, *options, cwd=tmp_path)
    tables = [text[text.index("Held-out") : text.index("Starts at")] for text in (shown, again)]
    assert tables[0] == tables[1], "the same seeds, the same models"


def test_car_example_gives_its_tables_and_pictures(tmp_path):
    out = tmp_path / "out"
    learning = ("--plans", 15, "--validation", 2, "--rounds", 2)
    size = (*learning, "--scenes", 3, "--test-scenes", 1, "--queries", 1)
    done = completed("-m", "benchmarks.car", *size, "--jobs", 1, "--out", out, cwd=tmp_path)
    shown = done.stdout
    assert "Round 1:" in done.stderr
    assert "Best accuracy that any classifier of b, u and E can have here" in shown
    assert "Random scenes: success is within 0.3" in shown
    results = json.loads((out / "results.json").read_text())
    for planners in results.values():
        assert list(planners) == ["none", "classifier", "waypoints moved", "ours", "ceiling"]
    assert [len(rows) for rows in results["Random scenes"].values()] == [1] * 5
    for name in ("fan.png", "speeds.png", "trees.png", "executions.gif", "calibration.png"):
        assert 5_000 < (out / name).stat().st_size < 300_000


def test_rope_example_shows_a_rope_that_got_caught_and_one_that_did_not(tmp_path):
    options = ("simple_hook_short", "--size", 160, 120, "--plans", 8, "--out", tmp_path)
    shown = run("-m", "benchmarks.rope", *options, cwd=tmp_path)
    assert "without a classifier: planned in" in shown
    assert "stopped there" in shown
    assert "Every command was carried out" in shown
    pictures = {file.name for file in (tmp_path / "simple_hook_short").iterdir()}
    assert pictures == {"caught.png", "worked.png", "caught_and_worked.gif"}


def test_acceptance_rules_are_compared_on_the_same_problems(tmp_path, arm_classifier):
    (tmp_path / "arm").mkdir()
    joblib.dump(arm_classifier, tmp_path / "arm" / "arm.joblib")
    table = tmp_path / "acceptance" / "table.md"
    kept = {}
    for n_problems in (2, 3):
        options = ("--systems", "arm", "--problems", n_problems, "--out", table.parent)
        compare_acceptance([str(option) for option in options])
        rows = [line.split(" | ") for line in table.read_text().splitlines()[2:]]
        assert [(row[1], float(row[2])) for row in rows] == list(SETTINGS)
        assert all(f"of {n_problems}, " in row[3] for row in rows)
        files = {file: file.read_bytes() for file in table.parent.glob("*/*.item")}
        assert len(files) == n_problems * len(SETTINGS)
        assert kept.items() <= files.items(), "more problems go on where fewer stopped"
        kept = files


def test_own_systems_goes_all_roads_and_counts_each(tmp_path):
    size = ("--plans", 120, "--problems", 6, "--first-seed", 50)
    options = ("--systems", "suspended load", *size, "--out", tmp_path / "out")
    shown = run("-m", "benchmarks.own_systems", *options, cwd=tmp_path)
    for road in ("none", "0.1", "new, one plan", "new", "new, replanning"):
        assert re.search(rf"^{road}: \d of 6, ", shown, flags=re.M)
    assert "balanced accuracy (chance is 0.5)" in shown
    assert re.search(r"^Failures (not )?halved: \d with the new road, \d without\.$", shown, re.M)
    again = run("-m", "benchmarks.own_systems", *options, cwd=tmp_path)
    assert shown.splitlines()[-1] == again.splitlines()[-1]


def test_labels_compares_the_same_executions_labelled_in_several_ways(tmp_path):
    options = ("--systems", "suspended load", "--share", 0.05, "--out", tmp_path / "out")
    shown = run("-m", "benchmarks.labels", *options, cwd=tmp_path)
    rows = {
        kind: int(re.search(rf"^{kind} +([\d,]+) +[\d.]+%", shown, flags=re.M)[1].replace(",", ""))
        for kind in ("plan", "plan, cut", "executed", "both", "both, cut")
    }
    assert rows["plan, cut"] < rows["plan"]
    assert rows["both"] == rows["plan"] + rows["executed"]
    assert rows["both, cut"] == rows["plan, cut"] + rows["executed"]
    assert re.search(r"^executed +\d+ +\d+ .* : \d+  \(p = ", shown, flags=re.M)
