"""Table I's benchmark: trials that resume, and a table beside the paper's."""

import joblib
import numpy as np
import pytest
from sklearn.dummy import DummyClassifier
from sklearn.ensemble import HistGradientBoostingClassifier

from benchmarks.rope import table1
from reliability import ResumableStore, StoreError

TIMES = ("planning", "smoothing")


def trials_in(folder):
    store = ResumableStore.at(folder)
    return [store.read(name).facts for name in store.names()]


def test_processes_find_what_one_finds(tmp_path, capsys):
    options = ["--scenes", "engine_assembly", "--seeds", "2", "--time-limit", "60"]
    model = HistGradientBoostingClassifier(max_iter=2).fit(np.zeros((4, 13)), [0, 1, 1, 1])
    joblib.dump(model, tmp_path / "reliable.joblib")
    options += ["--columns", str(tmp_path / "reliable.joblib"), "--features", "vector"]
    options += ["--accuracy", "0.9"]
    found = []
    for jobs in ("1", "2"):
        table1.main([*options, "--jobs", jobs, "--out", str(tmp_path / jobs)])
        trials = trials_in(tmp_path / jobs / "reliable")
        found.append([{k: v for k, v in trial.items() if k not in TIMES} for trial in trials])
    assert len(found[0]) == 2
    assert found[0] == found[1]


def test_pbd_ropes_without_a_classifier_are_a_column_of_their_own(tmp_path, capsys):
    options = ["--scenes", "engine_assembly", "--seeds", "1", "--out", str(tmp_path)]
    table1.main([*options, "--columns", "none", "pbd"])
    rows = [line.split(" | ")[1:3] for line in capsys.readouterr().out.splitlines()[2:4]]
    assert [name for name, _ in rows] == ["none", "pbd"]
    (none,), (pbd,) = (trials_in(tmp_path / name) for name in ("none", "pbd"))
    assert none["n_nodes"] != pbd["n_nodes"], "what is carried decides what is valid"


def test_trials_resume_and_any_estimator_fits(tmp_path, capsys):
    options = ["--scenes", "engine_assembly", "--seeds", "2", "--out", str(tmp_path)]
    table1.main(options)
    first = capsys.readouterr().out
    files = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*.item")}
    assert {file.name for file in files} == {f"engine_assembly-seed-00{i}.item" for i in range(2)}
    assert "| 1/30 |" in first
    table1.main(options)
    assert capsys.readouterr().out == first
    assert {file: file.stat().st_mtime_ns for file in files} == files
    with pytest.raises(StoreError, match=r"planner.parameters.time_limit: 600.0 then, 5.0 now"):
        table1.main([*options, "--time-limit", "5"])

    model = DummyClassifier(strategy="constant", constant=1)
    joblib.dump(model.fit(np.zeros((2, 13)), [0, 1]), tmp_path / "all.joblib")
    columns = ["--columns", "none", str(tmp_path / "all.joblib"), "--features", "vector"]
    table1.main([*options, *columns, "--accuracy", "0.9"])
    output = capsys.readouterr().out
    assert "| 1/30 |" in output
    assert "| 10/30 |" in output
    assert len(list(tmp_path.rglob("*.item"))) == 4
