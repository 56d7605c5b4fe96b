"""Table I's benchmark: trials that resume, and a table beside the paper's."""

import json

import joblib
import numpy as np
from sklearn.dummy import DummyClassifier
from sklearn.ensemble import HistGradientBoostingClassifier

from benchmarks.rope import table1


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


def test_loose_ropes_without_a_classifier_are_a_column_of_their_own(tmp_path, capsys):
    options = ["--scenes", "engine_assembly", "--seeds", "1", "--out", str(tmp_path)]
    table1.main([*options, "--columns", "none", "pbd"])
    rows = [line.split(" | ")[1:3] for line in capsys.readouterr().out.splitlines()[2:4]]
    assert [name for name, _ in rows] == ["none", "pbd"]
    (none,), (loose,) = (tmp_path.glob(f"{name}-*/*/seed-000.json") for name in ("none", "pbd"))
    found = [json.loads(file.read_text()) for file in (none, loose)]
    assert found[0]["n_nodes"] != found[1]["n_nodes"], "what is carried decides what is valid"


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
