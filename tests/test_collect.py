"""Collection: the same data however it was cut up, interrupted or spread."""

import warnings

import joblib
import numpy as np
import pytest
from test_transitions import assert_equal
from toy_systems import Disc, Unstable

from planners import BiasedRRTConnect
from reliability import UNRELIABLE, Transitions, collect_transitions, label_transitions

N_PLANS = 120  # Three shards, the last one short.


@pytest.fixture(scope="module")
def whole():
    return collect(Disc())


def collect(system, n_plans=N_PLANS, **parameters):
    planner = BiasedRRTConnect(system, max_iterations=2000)
    return collect_transitions(system, planner, n_plans, **{"random_state": 3} | parameters)


def test_labels_and_plans_are_those_of_the_executions(whole):
    system = Disc()
    assert len(np.unique(whole.plan)) == N_PLANS
    for plan in (0, 57, 119):
        rows = whole[whole.plan == plan]
        assert rows.step.tolist() == list(range(len(rows)))
        np.testing.assert_array_equal(rows.next_reduced[:-1], rows.reduced[1:])
        rollout = system.rollout(rows.reduced[0], rows.command)
        predicted = np.concatenate([rows.reduced, rows.next_reduced[-1:]])
        expected = label_transitions(predicted, np.array(rollout.states), system.close)
        np.testing.assert_array_equal(rows.y, expected)
    assert 0.05 < np.mean(whole.y == UNRELIABLE) < 0.9


@pytest.mark.parametrize("n_jobs", [2, -1])
def test_data_do_not_depend_on_processes(whole, n_jobs):
    assert_equal(collect(Disc(), n_jobs=n_jobs), whole)


def test_any_joblib_backend_will_do(whole):
    with joblib.parallel_config(backend="threading", n_jobs=2):
        assert_equal(collect(Disc()), whole)


def test_a_collection_with_a_path_gives_the_same(whole, tmp_path):
    assert_equal(collect(Disc(), path=tmp_path / "data"), whole)
    assert_equal(collect(Disc(), path=tmp_path / "data"), whole)


def test_a_killed_collection_goes_on_where_it_stopped(whole, tmp_path, monkeypatch):
    path = tmp_path / "data"
    saved = []
    save = Transitions.save

    def save_once(self, target):
        if saved:
            raise KeyboardInterrupt
        saved.append(target)
        save(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(Transitions, "save", save_once)
        with pytest.raises(KeyboardInterrupt):
            collect(Disc(), path=path)
    written = {file.name: file.stat().st_mtime_ns for file in path.glob("shard-*.npz")}
    assert len(written) == 1

    assert_equal(collect(Disc(), path=path, n_jobs=2), whole)
    after = {file.name: file.stat().st_mtime_ns for file in path.glob("shard-*.npz")}
    assert len(after) == 3
    assert after.items() >= written.items(), "finished shards are not made again"


def test_without_a_seed_a_folder_keeps_the_one_it_began_with(tmp_path):
    first = collect(Disc(), 10, random_state=None, path=tmp_path / "data")
    assert_equal(collect(Disc(), 10, random_state=None, path=tmp_path / "data"), first)


def test_generators_advance(rng):
    first, second = (collect(Disc(), 5, random_state=rng) for _ in range(2))
    assert first.reduced[0, 0] != second.reduced[0, 0]


def test_other_arguments_are_refused_for_the_same_folder(tmp_path):
    path = tmp_path / "data"
    collect(Disc(), 10, path=path)
    for system, n_plans, seed, named in (
        (Disc(), 11, 3, "n_plans: 10 then, 11 now"),
        (Disc(), 10, 4, "random_state: 3 then, 4 now"),
        (Disc(sticky=False), 10, 3, "system: "),
    ):
        with pytest.raises(ValueError, match=r"collected with other arguments \(.*" + named):
            collect(system, n_plans, path=path, random_state=seed)


def test_diverged_plans_are_dropped_and_counted():
    with pytest.warns(UserWarning, match="plans were dropped because the simulator") as caught:
        transitions = collect(Unstable(), 40)
    n_dropped = int(str(caught[0].message).split()[0])
    n_kept = len(np.unique(transitions.plan))
    assert n_dropped > 5
    assert n_kept == 40 - n_dropped


def test_progress_and_summary_on_request(capsys):
    collect(Disc(), 5, verbose=1)
    output = capsys.readouterr()
    assert "1/1" in output.err
    assert "transitions of 5 plans" in output.out
    assert "0 of 5 plans were not solved" in output.out
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        collect(Disc(), 5)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("n_plans", [0, -3, 2.5, True, "many"])
def test_a_bad_number_of_plans_is_refused(n_plans):
    with pytest.raises(ValueError, match="n_plans must be a positive integer"):
        collect(Disc(), n_plans)


def test_data_without_transitions_are_refused():
    class Unsolvable(BiasedRRTConnect):
        def plan(self, start_reduced, goal):
            result = super().plan(start_reduced, goal)
            return type("Unsolved", (), {"success": False, "reduced": result.reduced})()

    with pytest.raises(ValueError, match="None of 5 plans gave a transition: 5 were not solved"):
        collect_transitions(Disc(), Unsolvable(Disc()), 5, random_state=0)
