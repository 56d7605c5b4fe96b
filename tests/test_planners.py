"""Both planners: sound plans, seeds, limits, and errors at the door."""

import pickle
import re
from dataclasses import replace

import joblib
import numpy as np
import pytest
from test_check_transition import RightIsUnreliable
from toy_systems import Disc, Odometer

from planners import BiasedRRT, BiasedRRTConnect, PlanResult, PlanStatus
from reliability.archive import write_arrays

START, GOAL = np.array([-0.9, -0.1]), np.array([0.9, 0.1])
PLANNERS = [BiasedRRTConnect, BiasedRRT]


class HalfPlane:
    """Distrusts y < 0, fast or slowly; remembers what it was asked."""

    classes_ = np.array([0, 1])
    validation_accuracy_ = 0.9

    def __init__(self):
        self.asked = []

    def __repr__(self):
        return type(self).__name__  # names tests, the same in each process

    def predict(self, X):
        self.asked.append(X.copy())
        return (X[:, 1] >= 0).astype(int)


class FastHalfPlane(HalfPlane):
    def fast_decision_function(self, X):
        return np.where(self.predict(X) == 1, 1e3, -1e3)


class Nowhere(HalfPlane):
    def predict(self, X):
        return np.zeros(len(X), dtype=int)


def assert_sound(system, result, start, goals):
    assert result.status is PlanStatus.SOLVED
    assert result.success
    np.testing.assert_array_equal(result.reduced[0], start)
    assert system.goal_reached(result.reduced[-1:], np.atleast_2d(goals))[0]
    following, valid = system.propagate(result.reduced[:-1], result.commands)
    assert valid.all()
    np.testing.assert_allclose(following, result.reduced[1:], atol=1e-12)
    moves = np.diff(result.reduced[:, : system.configuration_dim], axis=0)
    assert (np.linalg.norm(moves, axis=1) <= system.step_size * (1 + 1e-8)).all()


def assert_same_plan(one, other):
    for name in ("reduced", "commands", "tree"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for name in ("status", "n_checked", "n_rejected", "n_accepted_unreliable", "random_state"):
        assert getattr(one, name) == getattr(other, name)
    if one.reliability is None:
        assert other.reliability is None
    else:
        np.testing.assert_allclose(one.reliability, other.reliability, rtol=1e-12)


@pytest.mark.parametrize("simplify", [True, False])
@pytest.mark.parametrize("estimator", [None, HalfPlane(), FastHalfPlane()], ids=str)
@pytest.mark.parametrize("planner", PLANNERS)
def test_plans_follow_the_model(planner, estimator, simplify):
    for seed in range(5):
        result = planner(Disc(), estimator, simplify=simplify, random_state=seed).plan(START, GOAL)
        assert_sound(Disc(), result, START, GOAL)


@pytest.mark.parametrize("planner", PLANNERS)
def test_several_goals_are_alternatives(planner, arm):
    goals = np.array([[1.0, 1, 1], [-1, -1, -1], [0, 2, 0]])
    reached = set()
    for seed in range(12):
        result = planner(arm, random_state=seed).plan([0.1, 0.2, 0.3], goals)
        assert_sound(arm, result, [0.1, 0.2, 0.3], goals)
        reached.add(tuple(result.reduced[-1]))
    assert reached <= {tuple(goal) for goal in goals}


def rows_of(system, result):
    return {tuple(row) for row in system.features(result.reduced[:-1], result.reduced[1:])}


@pytest.mark.parametrize("kind", [HalfPlane, FastHalfPlane])
@pytest.mark.parametrize("planner", PLANNERS)
def test_every_transition_was_classified_as_it_will_be_executed(planner, kind):
    for seed in range(8):
        estimator = kind()
        result = planner(Disc(), estimator, simplify=False, random_state=seed).plan(START, GOAL)
        # The last question is the report's, about the plan itself.
        asked = np.concatenate(estimator.asked[:-1])
        for row in rows_of(Disc(), result):
            assert np.abs(asked - row).max(axis=1).min() < 1e-9


@pytest.mark.parametrize("kind", [HalfPlane, FastHalfPlane])
@pytest.mark.parametrize("planner", PLANNERS)
def test_shortcuts_let_no_unreliable_transition_in(planner, kind):
    system = Disc()
    for seed in range(15):
        parameters = {"k": 0.5, "random_state": seed}
        found = planner(system, kind(), simplify=False, **parameters).plan(START, GOAL)
        shorter = planner(system, kind(), simplify=True, **parameters).plan(START, GOAL)
        unreliable = shorter.reliability == 0
        rows = system.features(shorter.reduced[:-1], shorter.reduced[1:])[unreliable]
        assert {tuple(row) for row in rows} <= rows_of(system, found)
        assert len(shorter.commands) <= len(found.commands)
        assert shorter.n_accepted_unreliable == found.n_accepted_unreliable


class SureFarOut:
    """Calls every transition Reliable, and is sure of those that keep away from the disc."""

    classes_ = np.array([0, 1])
    validation_accuracy_ = 0.9

    def predict(self, X):
        return np.ones(len(X), dtype=int)

    def predict_proba(self, X):
        far_out = np.linalg.norm(X[:, :2], axis=1) > 0.65
        reliable = np.where(far_out, 0.999, 0.6)
        return np.column_stack([1 - reliable, reliable])


@pytest.mark.parametrize(
    ("planner", "system"),
    [(BiasedRRTConnect, Disc()), (BiasedRRT, Disc()), (BiasedRRT, Odometer())],
)
def test_a_shortcut_is_as_likely_to_go_well_as_what_it_replaces(planner, system):
    n_shorter = 0
    for seed in range(8):
        found, shortened = (
            planner(system, SureFarOut(), simplify=simplify, random_state=seed).plan(
                [*START, 0.0][: system.reduced_dim], GOAL
            )
            for simplify in (False, True)
        )
        assert shortened.success_probability >= found.success_probability * (1 - 1e-9)
        n_shorter += len(shortened.commands) < len(found.commands)
    assert n_shorter > 2


@pytest.mark.parametrize("kind", [HalfPlane, FastHalfPlane])
@pytest.mark.parametrize("planner", PLANNERS)
def test_infinite_k_plans_through_reliable_transitions_only(planner, kind):
    start, goal = np.array([-0.9, 0.1]), GOAL
    for seed in range(8):
        result = planner(Disc(), kind(), k=np.inf, random_state=seed).plan(start, goal)
        assert_sound(Disc(), result, start, goal)
        assert (result.reliability == 1).all()
        assert result.reduced[:-1, 1].min() >= 0
        assert result.n_accepted_unreliable == 0


@pytest.mark.parametrize("planner", PLANNERS)
def test_the_counts_add_up(planner):
    estimator = HalfPlane()
    result = planner(Disc(), estimator, simplify=False, random_state=1).plan(START, GOAL)
    assert result.n_checked == sum(len(rows) for rows in estimator.asked) - len(result.commands)
    unreliable = sum(int((rows[:, 1] < 0).sum()) for rows in estimator.asked)
    unreliable -= int((result.reliability == 0).sum())
    assert result.n_rejected + result.n_accepted_unreliable == unreliable
    assert result.planning_time > 0
    edges = result.tree
    assert edges.shape[1:] == (2, 2)
    assert len(edges) >= 2


@pytest.mark.parametrize("estimator", [None, HalfPlane(), FastHalfPlane()], ids=str)
@pytest.mark.parametrize("planner", PLANNERS)
def test_a_seed_gives_one_result_in_any_order_and_process(planner, estimator):
    planners = [planner(Disc(), estimator, random_state=seed) for seed in range(6)]
    first = [p.plan(START, GOAL) for p in planners]
    again = [p.plan(START, GOAL) for p in reversed(planners)][::-1]
    elsewhere = joblib.Parallel(n_jobs=2)(joblib.delayed(p.plan)(START, GOAL) for p in planners)
    for one, two, three in zip(first, again, elsewhere, strict=True):
        assert_same_plan(one, two)
        assert_same_plan(one, three)
    assert len({len(result.commands) for result in first}) > 1, "seeds differ"


def test_threads_do_not_disturb_each_other():
    planners = [BiasedRRTConnect(Disc(), random_state=seed) for seed in range(12)]
    alone = [p.plan(START, GOAL) for p in planners]
    together = joblib.Parallel(n_jobs=4, backend="threading")(
        joblib.delayed(p.plan)(START, GOAL) for p in planners
    )
    for one, other in zip(alone, together, strict=True):
        assert_same_plan(one, other)


def test_a_result_names_the_seed_that_gives_it_again():
    first = BiasedRRT(Disc()).plan(START, GOAL)
    again = BiasedRRT(Disc(), random_state=first.random_state).plan(START, GOAL)
    assert_same_plan(first, again)


@pytest.mark.parametrize("planner", PLANNERS)
def test_limits_end_the_search_with_a_remedy(planner):
    nothing = planner(Disc(), Nowhere(), k=np.inf, max_iterations=100, random_state=0)
    result = nothing.plan(START, GOAL)
    assert result.status is PlanStatus.ITERATION_LIMIT
    assert not result.success
    assert "Raise max_iterations" in result.status.value
    np.testing.assert_array_equal(result.reduced, START[None])
    assert result.commands.shape == (0, 2)
    assert result.reliability.shape == (0,)

    late = planner(Disc(), Nowhere(), k=np.inf, time_limit=1e-9, random_state=0)
    assert late.plan(START, GOAL).status is PlanStatus.TIME_LIMIT


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_start_at_the_goal_is_a_plan_of_nothing(planner):
    result = planner(Disc(), random_state=0).plan(START, START)
    assert result.success
    moved = np.linalg.norm(np.diff(result.reduced, axis=0), axis=1)
    assert moved.sum() == 0


@pytest.mark.parametrize("planner", PLANNERS)
def test_goals_that_are_unreliable_to_stay_at_are_left_out(planner):
    goals = np.array([[0.9, -0.5], [0.9, 0.5]])
    for seed in range(8):
        result = planner(Disc(), HalfPlane(), random_state=seed).plan([-0.9, 0.5], goals)
        np.testing.assert_allclose(result.reduced[-1], goals[1])


class LessAndLess:
    """Calls every transition Unreliable, the more so the lower it starts."""

    classes_ = np.array([0, 1])
    validation_accuracy_ = 0.9

    def predict(self, X):
        return np.zeros(len(X), dtype=int)

    def predict_proba(self, X):
        reliable = 0.4 + 0.05 * X[:, 1]
        return np.column_stack([1 - reliable, reliable])


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0, 1], [1, 2, 0]])
def test_the_most_reliable_goal_is_kept_when_none_is_reliable(planner, order):
    goals = np.array([[0.9, -0.9], [0.9, 0.6], [0.9, -0.5]])
    result = planner(Disc(), LessAndLess(), k=0.1, random_state=0).plan([-0.9, 0.5], goals[order])
    assert result.success
    np.testing.assert_allclose(result.reduced[-1], goals[1])


def test_the_rest_of_the_state_is_propagated():
    system = Odometer()
    start = np.array([*START, 2.0])
    result = BiasedRRT(system, HalfPlane3(), random_state=0).plan(start, GOAL)
    assert_sound(system, result, start, GOAL)
    way = np.linalg.norm(result.commands, axis=1).sum()
    assert result.reduced[-1, 2] == pytest.approx(2 + way)
    with pytest.raises(ValueError, match="that of Odometer holds 1 more numbers; use BiasedRRT"):
        BiasedRRTConnect(system).plan(start, GOAL)


class HalfPlane3(HalfPlane):
    """The same over the odometer's six features."""


def test_commands_that_move_nothing_add_nothing():
    class Sticky(Disc):
        def propagate(self, reduced, command):
            following, valid = super().propagate(reduced, command)
            return np.where(reduced[:, :1] > 0.5, reduced, following), valid

    result = BiasedRRT(Sticky(), max_iterations=200, random_state=0).plan(START, GOAL)
    assert not result.success
    assert (result.tree[:, 0] != result.tree[:, 1]).any(axis=1).all()
    assert len(result.tree) > 100


@pytest.mark.parametrize("planner", PLANNERS)
def test_exceptions_of_users_code_come_out_unchanged(planner):
    error = RuntimeError("the user's own")

    class Broken(HalfPlane):
        def predict(self, X):
            if len(self.asked) > 3:
                raise error
            return super().predict(X)

    with pytest.raises(RuntimeError) as caught:
        planner(Disc(), Broken(), random_state=0).plan(START, GOAL)
    assert caught.value is error

    class BrokenDisc(Disc):
        def steer(self, reduced, configuration):
            if len(reduced) > 1:
                raise error
            return super().steer(reduced, configuration)

    with pytest.raises(RuntimeError) as caught:
        planner(BrokenDisc(), random_state=0).plan(START, GOAL)
    assert caught.value is error
    assert planner(Disc(), random_state=0).plan(START, GOAL).success


@pytest.mark.parametrize("planner", PLANNERS)
def test_planners_pickle_and_show_their_parameters(planner):
    original = planner(Disc(), k=3.0, random_state=5)
    again = pickle.loads(pickle.dumps(original))
    assert_same_plan(original.plan(START, GOAL), again.plan(START, GOAL))
    assert original.get_params()["k"] == 3.0
    assert original.set_params(k=2.0).k == 2.0


@pytest.mark.parametrize("estimator", [None, HalfPlane()], ids=str)
def test_results_are_saved_in_one_file(estimator, tmp_path):
    result = BiasedRRT(Disc(), estimator, random_state=0).plan(START, GOAL)
    result.save(tmp_path / "plan.npz")
    again = PlanResult.load(tmp_path / "plan.npz")
    assert_same_plan(again, result)
    assert again.planning_time == result.planning_time
    path = tmp_path / "plan.npz"
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(ValueError, match="not a whole file of a plan"):
        PlanResult.load(path)
    np.savez(path, format_version=np.array(7))
    with pytest.raises(ValueError, match="format version 7 and this library reads 2"):
        PlanResult.load(path)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("status", "a"),
        ("status", [1, 2]),
        ("random_state", "a"),
        ("n_checked", -1),
        ("n_rejected", 0.5),
        ("n_accepted_unreliable", "a"),
        ("planning_time", np.nan),
        ("turning", "a"),
        ("reliability", np.full(20, 7.0)),
        ("calibrated_probability", 7.0),
        ("commands", np.full((20, 2), np.nan)),
    ],
)
def test_a_file_that_holds_no_plan_is_refused(tmp_path, name, value):
    """Its digest is right: it was written by another version or author."""
    path = tmp_path / "plan.npz"
    plan = BiasedRRTConnect(Disc(), HalfPlane(), random_state=0).plan(START, GOAL)
    plan.save(path)
    with np.load(path) as archive:
        arrays = {key: archive[key] for key in archive if key not in ("digest", "format_version")}
    if name in ("reliability", "commands"):
        value = value[: len(plan.commands)]
    write_arrays(path, arrays | {name: np.asarray(value)}, format_version=2)
    with pytest.raises(ValueError, match=r"plan\.npz is not a whole file of a plan"):
        PlanResult.load(path)
    if name not in ("status", "random_state"):
        with pytest.raises(ValueError, match=name):
            replace(plan, **{name: value}).save(path)


def test_a_seed_of_any_size_is_saved(tmp_path):
    result = BiasedRRT(Disc(), random_state=2**200).plan(START, GOAL)
    result.save(tmp_path / "plan.npz")
    assert PlanResult.load(tmp_path / "plan.npz").random_state == 2**200


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("commands", lambda rows: rows * np.nan),
        ("commands", lambda rows: rows[:-1]),
        ("reduced", lambda rows: rows[:, 0]),
        ("reliability", lambda rows: rows[1:]),
    ],
)
def test_files_whose_arrays_do_not_go_together_are_refused(name, change, tmp_path):
    path = tmp_path / "plan.npz"
    plan = BiasedRRT(Disc(), HalfPlane(), random_state=0).plan(START, GOAL)
    changed = change(getattr(plan, name))
    with pytest.raises(ValueError, match=r"(commands|reduced|reliability) must"):
        replace(plan, **{name: changed}).save(path)
    plan.save(path)
    arrays = dict(np.load(path))
    version = int(arrays.pop("format_version"))
    del arrays["digest"]
    write_arrays(path, arrays | {name: changed}, format_version=version)
    with pytest.raises(ValueError, match=r"plan.npz is not a whole file of a plan \("):
        PlanResult.load(path)


def test_files_that_were_changed_are_refused(tmp_path):
    path = tmp_path / "plan.npz"
    BiasedRRT(Disc(), HalfPlane(), random_state=0).plan(START, GOAL).save(path)
    arrays = dict(np.load(path))
    np.savez(path, **arrays | {"commands": arrays["commands"] + 0.01})
    with pytest.raises(ValueError, match=r"plan.npz was changed after it had been written"):
        PlanResult.load(path)


def test_a_result_prints_in_one_line():
    text = repr(BiasedRRT(Disc(), HalfPlane(), random_state=0).plan(START, GOAL))
    assert re.fullmatch(
        r"PlanResult\(SOLVED, \d+ commands, success_probability=[\d.]+, random_state=0\)", text
    )


@pytest.mark.parametrize("limit", [np.float32(5), np.int64(5), 0.5])
def test_numpys_numbers_are_time_limits(limit):
    assert BiasedRRT(Disc(), time_limit=limit, random_state=0).plan(START, START).success


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0.9], GOAL), r"start_reduced must have the shape \(2\), got \(1,\)"),
        (([np.nan, 0], GOAL), "start_reduced must be finite"),
        (([57.3, 0], GOAL), r"start_reduced must lie near the bounds \[-1.0, -1.0\] .* units\?"),
        (([0, 0], GOAL), "start_reduced must be a state from which propagate is valid"),
        ((START, [0.9]), "goal must have the shape"),
        ((START, [0.9, np.inf]), "goal must be finite"),
        ((START, [0.9, 1.1]), "goal must lie within the bounds"),
        (
            (START, [[0.9, np.nan], [0.9, -3], [0.1, 0.1]]),
            r"goal must hold a configuration that can be reached: goal\[0\] must be finite, got "
            r"\[0.9, nan\]; goal\[1\] must lie within the bounds \[-1.0, -1.0\] to \[1.0, 1.0\], "
            r"got \[0.9, -3.0\]; goal\[2\] must be a configuration at which propagate is valid",
        ),
        ((START, np.full((7, 2), 5)), r"goal\[4\] must lie within .*; 2 more\."),
        ((START, np.empty((0, 2))), "goal must hold at least one configuration"),
        ((START, [0.1, 0.1]), r"goal must be a configuration at which propagate is valid, got \[0"),
    ],
)
@pytest.mark.parametrize("planner", PLANNERS)
def test_bad_problems_are_refused(planner, arguments, message):
    with pytest.raises(ValueError, match=message):
        planner(Disc()).plan(*arguments)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"system": "arm"}, "system must be a System, got 'arm'"),
        ({"max_iterations": 0}, "max_iterations must be a positive integer, got 0"),
        ({"max_iterations": 1.5}, "max_iterations must be a positive integer"),
        ({"time_limit": -1}, "time_limit must be None or positive seconds, got -1"),
        ({"random_state": -4}, "random_state must not be negative"),
        ({"random_state": "x"}, "random_state must be None, an integer"),
        ({"k": -0.5}, "k must be a number between 0 and inf"),
    ],
)
@pytest.mark.parametrize("planner", PLANNERS)
def test_bad_parameters_are_refused_by_plan(planner, parameters, message):
    unchecked = planner(**{"system": Disc()} | parameters)
    with pytest.raises(ValueError, match=message):
        unchecked.plan(START, GOAL)


@pytest.mark.parametrize("n", [0, 2.5, True])
def test_a_bad_edge_length_is_refused(n):
    with pytest.raises(ValueError, match="transitions_per_edge must be a positive integer"):
        BiasedRRTConnect(Disc(), transitions_per_edge=n).plan(START, GOAL)


def test_longer_edges_hold_more_transitions():
    short = BiasedRRTConnect(Disc(), transitions_per_edge=1, simplify=False, random_state=0)
    edges = short.plan(START, GOAL).tree
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    assert lengths.max() <= Disc.step_size * (1 + 1e-9)
    edges = short.set_params(transitions_per_edge=4).plan(START, GOAL).tree
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    assert 2 * Disc.step_size < lengths.max() <= 4 * Disc.step_size * (1 + 1e-9)


def test_opaque_estimators_are_asked_about_many_extensions_at_once():
    for planner in PLANNERS:
        estimator = RightIsUnreliable()
        search = planner(Disc(), estimator, accuracy=0.9, k=3, simplify=False, random_state=0)
        result = search.plan(START, GOAL)
        assert result.n_checked / len(estimator.asked) > 5
