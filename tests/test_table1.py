"""Table I's benchmark: trials that resume, and a table beside the paper's."""

import json
import sys
from pathlib import Path

import joblib
import numpy as np
from sklearn.dummy import DummyClassifier
from sklearn.ensemble import HistGradientBoostingClassifier

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
import table1


def test_processes_find_what_one_finds(tmp_path, capsys):
    options = ["--scenes", "engine_assembly", "--seeds", "2", "--time-limit", "60"]
    model = HistGradientBoostingClassifier(max_iter=2).fit(np.zeros((4, 13)), [0, 1, 1, 1])
    joblib.dump(model, tmp_path / "reliable.joblib")
    options += ["--columns", str(tmp_path / "reliable.joblib"), "--features", "vector"]
    options += ["--accuracy", "0.9"]
    found = []
    for jobs in ("1", "2"):
        table1.main([*options, "--jobs", jobs, "--out", str(tmp_path / jobs)])
        trials = sorted((tmp_path / jobs).rglob("seed-*.json"))
        found.append([json.loads(trial.read_text()) for trial in trials])
        for trial in found[-1]:
            del trial["planning"], trial["smoothing"]
    assert len(found[0]) == 2
    assert found[0] == found[1]


def test_trials_resume_and_any_estimator_fits(tmp_path, capsys):
    options = ["--scenes", "engine_assembly", "--seeds", "2", "--out", str(tmp_path)]
    table1.main(options)
    first = capsys.readouterr().out
    files = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("seed-*.json")}
    assert len(files) == 2
    assert "| 1/30 |" in first
    table1.main(options)
    assert capsys.readouterr().out == first
    assert {file: file.stat().st_mtime_ns for file in files} == files

    model = DummyClassifier(strategy="constant", constant=1)
    joblib.dump(model.fit(np.zeros((2, 13)), [0, 1]), tmp_path / "all.joblib")
    columns = ["--columns", "none", str(tmp_path / "all.joblib"), "--features", "vector"]
    table1.main([*options, *columns, "--accuracy", "0.9"])
    output = capsys.readouterr().out
    assert "| 1/30 |" in output
    assert "| 10/30 |" in output
    assert len(list(tmp_path.rglob("seed-*.json"))) == 4
