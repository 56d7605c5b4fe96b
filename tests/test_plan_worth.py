"""The benchmark of what plans are worth, at small size."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import acceptance
from benchmarks.calibration_error import calibration_error
from benchmarks.plan_worth import measured_systems, peg
from benchmarks.plan_worth.__main__ import main
from benchmarks.plan_worth.measures import error_of_the_truth


def test_the_calibration_error_is_the_mean_gap_of_ten_bins():
    probability = np.array([0.05, 0.05, 0.91, 0.99, 1.0])
    succeeded = np.array([False, True, True, True, False])
    gaps = [abs(1 - 0.1), abs(2 - 2.9)]
    assert calibration_error(probability, succeeded) == pytest.approx(sum(gaps) / 5)
    assert calibration_error(np.array([0.0, 1.0]), np.array([False, True])) == 0


def test_true_probabilities_show_an_error_that_shrinks_with_the_number_of_plans(rng):
    few, many = (error_of_the_truth(rng.random(n)).mean() for n in (50, 5000))
    assert 0.05 < few < 0.2
    assert many < 0.02


def test_a_table_a_picture_and_restarts(tmp_path, monkeypatch, capsys):
    small = replace(measured_systems.SYSTEMS["arm"], learned_from=40)
    monkeypatch.setitem(measured_systems.SYSTEMS, "arm", small)
    monkeypatch.setattr("benchmarks.plan_worth.__main__.N_RESTART_PROBLEMS", 4)
    arguments = ["--systems", "arm", "--plans", "30", "20", "25", "--out", str(tmp_path)]
    main([*arguments, "--restarts", "1"])
    shown = capsys.readouterr().out
    row = next(line for line in shown.splitlines() if line.startswith("| arm "))
    assert row.count("|") == 11
    assert "arm, once: " in shown
    assert "restarts win" in shown
    assert (tmp_path / "plan_worth.png").stat().st_size > 10_000
    main(arguments)
    assert row in capsys.readouterr().out, "the same plans are not made again"


def test_pegs_stand_in_the_way():
    rope = peg.peg_rope(0)
    problem = rope.sample_problem(1)
    assert problem.goal[0, 2] < -0.1 < problem.start.grippers[0, 2]
    thin = rope.scene.obstacles[1]
    assert thin.center[2] + thin.half_length == pytest.approx(-0.05)


def n_features(rope):
    reduced = rope.reduce(rope.scene_problem().start)[None]
    return rope.features(reduced, reduced).shape[1]


def test_benchmarks_find_the_rope_models_that_come_with_them(tmp_path):
    measured = measured_systems.SYSTEMS["rope"]
    classifier = measured.classifier(tmp_path, 1)
    assert classifier.n_features_in_ == n_features(measured.system(0))
    assert peg.planner("ours").estimator.n_features_in_ == n_features(peg.peg_rope(0))
    for problem in (acceptance.simple_hook, acceptance.engine_assembly):
        rope, _ = problem(0, 0)
        assert acceptance.rope_model(tmp_path).n_features_in_ == n_features(rope)
