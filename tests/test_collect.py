"""Collection: the same data however it was cut up, interrupted or spread."""

import json
import shutil
import warnings

import joblib
import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression
from test_transitions import assert_equal
from toy_systems import Disc, Odometer, Unstable

from planners import BiasedRRT, BiasedRRTConnect
from reliability import (
    UNRELIABLE,
    PlanFailedError,
    StoreError,
    collect_transitions,
    label_executed_transitions,
    label_transitions,
)
from systems import PlanarArm

N_PLANS = 120


@pytest.fixture(scope="module")
def whole():
    return collect(Disc())


def collect(system, n_plans=N_PLANS, **parameters):
    kind = BiasedRRT if isinstance(system, Odometer) else BiasedRRTConnect
    planner = kind(None, max_iterations=2000)
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


def test_a_relative_path_is_of_the_folder_that_the_caller_is_in(tmp_path, monkeypatch):
    collect(Disc(), 4, n_jobs=2)  # Starts workers, which stay where they were started.
    monkeypatch.chdir(tmp_path)
    data = collect(Disc(), 4, n_jobs=2, path="data")
    assert len(list((tmp_path / "data").glob("*.item"))) == 4
    assert_equal(collect(Disc(), 4, path=tmp_path / "data"), data)


@pytest.mark.parametrize(("stopped_at", "n_jobs"), [(0, 1), (7, 2), (39, 1)])
def test_interrupted_at_any_plan_it_keeps_all_finished_plans_and_ends_with_the_same_bytes(
    tmp_path, stopped_at, n_jobs
):
    expected = collect(Disc(), 40, path=tmp_path / "whole")
    path, planner = tmp_path / "data", BiasedRRTConnect(Disc(), max_iterations=2000)

    class Interrupted(BiasedRRTConnect):
        n_left = stopped_at

        def plan(self, start_reduced, goal):
            if Interrupted.n_left == 0:
                raise KeyboardInterrupt
            Interrupted.n_left -= 1
            return planner.set_params(random_state=self.random_state).plan(start_reduced, goal)

    Interrupted.__qualname__ = "BiasedRRTConnect"
    interrupted = Interrupted(Disc(), max_iterations=2000)
    with pytest.raises(KeyboardInterrupt):
        collect_transitions(Disc(), interrupted, 40, random_state=3, path=path)
    assert len(list(path.glob("plan-*"))) == stopped_at

    assert_equal(collect(Disc(), 40, path=path, n_jobs=n_jobs), expected)
    assert contents(path) == contents(tmp_path / "whole")


def contents(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def test_more_plans_extend_a_folder_and_fewer_are_its_first(whole, tmp_path):
    path = tmp_path / "data"
    first = collect(Disc(), 40, path=path)
    assert_equal(first, whole[whole.plan < 40])
    before = contents(path)
    assert_equal(collect(Disc(), path=path, n_jobs=2), whole)
    assert before.items() < contents(path).items(), "those that are there are not made again"
    assert_equal(collect(Disc(), 40, path=path), first)


def test_a_missing_plan_is_made_again_and_a_damaged_one_named(tmp_path):
    path = tmp_path / "data"
    data = collect(Disc(), 10, path=path)
    before = contents(path)
    files = sorted(path.glob("plan-*"))
    files[4].unlink()
    assert_equal(collect(Disc(), 10, path=path), data)
    assert contents(path) == before
    files[5].write_bytes(files[5].read_bytes()[:-8])
    with pytest.raises(StoreError, match=rf"{files[5].name} is damaged"):
        collect(Disc(), 10, path=path)
    files[5].write_bytes(files[6].read_bytes())
    with pytest.raises(StoreError, match="holds plan-0000006, not plan-0000005"):
        collect(Disc(), 10, path=path)


def test_plans_of_another_system_or_seed_are_noticed(tmp_path):
    path, other = tmp_path / "data", tmp_path / "other"
    collect(Disc(), 5, path=path)
    collect(Disc(sticky=False), 5, path=other)
    shutil.copy(other / "plan-0000002.item", path / "plan-0000002.item")
    with pytest.raises(StoreError, match=r"plan-0000002.item belongs to another store"):
        collect(Disc(), 5, path=path)
    (other / "manifest.json").unlink()
    with pytest.raises(StoreError, match="belongs to another store"):
        collect(Disc(sticky=False), 5, path=other, random_state=4)


def test_what_was_collected_is_told_in_words(tmp_path):
    collect(Disc(), 1, path=tmp_path)
    description = json.loads((tmp_path / "manifest.json").read_text())["description"]
    assert description["system"] == {"class": "Disc", "sticky": True}
    assert description["planner"]["class"] == "BiasedRRTConnect"
    assert description["planner"]["parameters"]["max_iterations"] == 2000
    assert description["labels"] == "plan"
    assert description["random_state"] == 3


def test_without_a_seed_a_folder_keeps_the_one_it_began_with(tmp_path):
    first = collect(Disc(), 10, random_state=None, path=tmp_path / "data")
    assert_equal(collect(Disc(), 10, random_state=None, path=tmp_path / "data"), first)


def test_generators_advance(rng):
    first, second = (collect(Disc(), 5, random_state=rng) for _ in range(2))
    assert first.reduced[0, 0] != second.reduced[0, 0]


def test_other_arguments_are_refused_for_the_same_folder(tmp_path):
    path = tmp_path / "data"
    collect(Disc(), 5, path=path)
    for system, parameters, named in (
        (Disc(), {"random_state": 4}, "random_state: 3 then, 4 now"),
        (Disc(sticky=False), {}, "system.sticky: true then, false now"),
        (Odometer(), {}, 'system.class: "Disc" then, "Odometer" now'),
        (Disc(), {"labels": "both"}, 'labels: "plan" then, "both" now'),
        ([Disc()], {}, r"system: .* then, \[.*\] now"),
    ):
        with pytest.raises(ValueError, match=r"made with other arguments \(.*" + named) as caught:
            collect(system, 5, path=path, **parameters)
        assert str(path) in str(caught.value)


def test_another_planner_is_refused_for_the_same_folder(tmp_path, disc_data):
    X, y, _ = disc_data
    estimator = LogisticRegression().fit(X, y)

    def collect_with(planner, n_plans=3):
        return collect_transitions(Disc(), planner, n_plans, random_state=3, path=tmp_path)

    data = collect_with(BiasedRRTConnect(Disc(), estimator, accuracy=0.8, k=1e-3))
    joblib.dump(estimator, tmp_path / "model")
    again = BiasedRRTConnect(None, joblib.load(tmp_path / "model"), accuracy=0.8, random_state=9)
    assert_equal(collect_with(again.set_params(k=np.float64(1e-3))), data)
    for planner, named in (
        (
            BiasedRRTConnect(Disc(), estimator, accuracy=0.8, k=2),
            "planner.parameters.k: 0.001 then",
        ),
        (BiasedRRTConnect(Disc()), "planner.parameters.estimator"),
        (BiasedRRT(Disc(), estimator, accuracy=0.8, k=1e-3), "planner.class"),
        (
            BiasedRRTConnect(Disc(), LogisticRegression().fit(X, 1 - y), accuracy=0.8, k=1e-3),
            "planner.parameters.estimator.fitted",
        ),
    ):
        with pytest.raises(StoreError, match=named):
            collect_with(planner)


def test_changed_physics_are_refused_for_the_same_folder(tmp_path, monkeypatch):
    collect(Disc(), 3, path=tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(Disc, "radius", 0.3)
        with pytest.raises(StoreError, match=r"code.Disc: "):
            collect(Disc(), 3, path=tmp_path)
    collect(Disc(), 3, path=tmp_path)


@pytest.mark.parametrize("other", [Disc(sticky=False), Odometer(), PlanarArm()])
def test_a_planner_for_another_system_is_refused(other):
    planner = BiasedRRT(other)
    for system in (Disc(), [Disc(), Disc()], random_disc):
        if type(other) is Disc and system is random_disc:
            continue  # which may be one that the callable returns
        with pytest.raises(ValueError, match=r"planner has the system .* not one of those"):
            collect_transitions(system, planner, 2, random_state=0)


def test_a_planner_is_a_template_and_stays_as_it_is():
    expected = collect(Disc(), 3)
    for planner in (BiasedRRTConnect(None), BiasedRRTConnect(Disc(), random_state=77)):
        planner.set_params(max_iterations=2000)
        before = planner.get_params(deep=False)
        assert_equal(collect_transitions(Disc(), planner, 3, random_state=3), expected)
        assert planner.get_params(deep=False) == before


def random_disc(random_state):
    rng = np.random.default_rng(random_state)
    return RandomDisc(float(rng.uniform(0.2, 0.5)))


class RandomDisc(Disc):
    def __init__(self, radius):
        super().__init__()
        self.radius = radius

    def features(self, reduced, next_reduced):
        return np.column_stack([reduced, next_reduced, np.full(len(reduced), self.radius)])


def test_systems_of_a_sequence_take_turns(tmp_path):
    discs = [RandomDisc(radius) for radius in (0.2, 0.35, 0.5)]
    data = collect(discs, 8, path=tmp_path)
    np.testing.assert_array_equal(data.scene, data.plan % 3)
    X = data.features(discs)
    np.testing.assert_array_equal(X[:, -1], np.array([0.2, 0.35, 0.5])[data.scene])
    np.testing.assert_array_equal(X[:, :2], data.reduced)
    some = data[data.scene == 1]
    np.testing.assert_array_equal(some.features(discs[1]), X[data.scene == 1])
    assert_equal(collect(discs, 8, path=tmp_path, n_jobs=2), data)
    with pytest.raises(ValueError, match="of 3 scenes and system is one System"):
        data.features(discs[0])
    with pytest.raises(ValueError, match="of scene 2, and system is a sequence of 2"):
        data.features(discs[:2])
    with pytest.raises(StoreError, match=r"system.1.radius: 0.35 then, 0.4 now"):
        collect([discs[0], RandomDisc(0.4), discs[2]], 8, path=tmp_path)


def test_a_callable_makes_a_scene_for_each_plan_and_the_same_again_of_its_id(tmp_path):
    data = collect(random_disc, 6, path=tmp_path)
    scenes = {int(data.scene[data.plan == plan][0]) for plan in range(6)}
    assert len(scenes) == 6
    X = data.features(random_disc)
    np.testing.assert_array_equal(X[:, -1], [random_disc(i).radius for i in data.scene])
    assert_equal(collect(random_disc, 6, n_jobs=2), data)
    assert_equal(collect(random_disc, 3, path=tmp_path), data[data.plan < 3])
    with pytest.raises(ValueError, match="must return a System for the random_state"):
        data.features(lambda random_state: None)


def test_many_systems_are_told_apart(tmp_path):
    discs = [RandomDisc(0.2 + 0.001 * i) for i in range(60)]
    collect(discs, 2, path=tmp_path)
    discs[41] = RandomDisc(0.5)
    with pytest.raises(StoreError, match=r"system.41: "):
        collect(discs, 2, path=tmp_path)


@pytest.mark.parametrize("system", [[], [Disc(), 3], "disc", 3, None])
def test_what_is_no_family_is_refused(system):
    with pytest.raises(ValueError, match="system must be a"):
        collect_transitions(system, BiasedRRTConnect(None), 2)


def test_labels_from_executed_states_are_those_of_the_function():
    plans = collect(Odometer(), 30, labels="plan")
    executed = collect(Odometer(), 30, labels="executed")
    both = collect(Odometer(), 30, labels="both")
    assert_equal(both[~both.executed], plans)
    assert_equal(both[both.executed], executed)
    assert not plans.executed.any()
    assert executed.executed.all()
    system = Odometer()
    n_left_out = 0
    for number in np.unique(plans.plan):
        planned, found = plans[plans.plan == number], executed[executed.plan == number]
        states = system.rollout(planned.reduced[0, :2], planned.command).states
        expected = label_executed_transitions(
            [system.reduce(state) for state in states],
            planned.command,
            system.propagate,
            system.close,
        )
        np.testing.assert_array_equal(found.reduced, expected.reduced)
        np.testing.assert_array_equal(found.next_reduced, expected.next_reduced)
        np.testing.assert_array_equal(found.y, expected.y)
        np.testing.assert_array_equal(found.command, planned.command[found.step])
        n_left_out += len(planned) - len(found)
    assert n_left_out > 0, "where the system is, g does not allow each command of the plan"
    assert np.mean(executed.y) > np.mean(plans.y), "what went wrong before is held against none"


class Brittle(Disc):
    """Raises where the first command goes left and up."""

    def rollout(self, state, commands):
        if len(commands) and commands[0][0] < 0 < commands[0][1]:
            raise ZeroDivisionError("a bug of mine")
        return super().rollout(state, commands)


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_a_plan_that_fails_is_told_with_all_that_makes_it_again(n_jobs):
    with pytest.raises(PlanFailedError) as caught:
        collect(Brittle(), 30, n_jobs=n_jobs)
    facts = caught.value.facts
    assert isinstance(caught.value.__cause__, ZeroDivisionError)
    message = str(caught.value)
    assert f"Plan {facts['plan']} " in message
    assert "ZeroDivisionError('a bug of mine')" in message
    assert "Problem(start=" in message
    problem_seed = np.random.SeedSequence(3, spawn_key=(facts["plan"],)).spawn(2)[0]
    problem = Brittle().sample_problem(problem_seed)
    assert repr(problem) == facts["problem"]
    planner = BiasedRRTConnect(Brittle(), max_iterations=2000, random_state=facts["random_state"])
    commands = planner.plan(problem.start, problem.goal).commands
    with pytest.raises(ZeroDivisionError):
        Brittle().rollout(problem.start, commands)


def test_failing_plans_can_be_left_out_and_are_known_when_it_goes_on(tmp_path):
    with pytest.warns(UserWarning, match="of 30 plans failed and were left out") as caught:
        data = collect(Brittle(), 30, on_error="skip", path=tmp_path)
    message = str(caught[0].message)
    failed = sorted(set(range(30)) - set(data.plan))
    assert 2 < len(failed) < 20
    assert message.startswith(f"{len(failed)} of 30")
    assert f"Plan {failed[0]} (scene 0, random_state of the planner" in message
    assert "a bug of mine" in message
    before = contents(tmp_path)
    with pytest.warns(UserWarning, match="failed and were left out") as caught:
        assert_equal(collect(Brittle(), 30, on_error="skip", path=tmp_path, n_jobs=2), data)
    assert str(caught[0].message) == message
    assert contents(tmp_path) == before
    with pytest.raises(PlanFailedError, match=f"Plan {failed[0]} "):
        collect(Brittle(), 30, path=tmp_path)
    kept = {file.name for file in tmp_path.glob("plan-*")}
    assert kept == {f"plan-{i:07d}.item" for i in set(data.plan)}, (
        "those that failed are tried again"
    )


def test_an_exception_that_does_not_pickle_comes_through():
    class UnpicklableError(Exception):
        def __reduce__(self):
            raise TypeError

    class Raising(Disc):
        def sample_problem(self, random_state=None):
            raise UnpicklableError("no problem")

    with pytest.raises(PlanFailedError, match=r"no problem.*Its problem: not drawn yet"):
        collect_transitions(Raising(), BiasedRRTConnect(None), 3, random_state=0, n_jobs=2)


@pytest.mark.parametrize("parameters", [{"labels": "none"}, {"on_error": "ignore"}])
def test_unknown_choices_are_refused(parameters):
    with pytest.raises(ValueError, match=f"{next(iter(parameters))} must be one of"):
        collect(Disc(), 2, **parameters)


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
    assert "0/5" in output.err
    assert "5/5" in output.err
    assert "transitions of 5 plans" in output.err
    assert "Of 5 plans 0 were not solved, 0 diverged, 0 failed." in output.err
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
