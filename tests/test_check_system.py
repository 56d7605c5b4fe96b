"""check_system says what a user's system got wrong."""

import os
import sys
import types
from enum import Enum

import joblib
import numpy as np
import pytest
from toy_systems import Disc, Odometer, RightOf, Shore, Turntable

from systems import Problem, Rollout, StopReason, SystemContractError, check_system


class PotholeReason(Enum):
    POTHOLE = "The wheel is in a pothole."
    NUMBERED = 3


def stopping_with(reason):
    """The rollout of a system that stops in its second command."""

    def rollout(self, state, commands):
        if len(commands) < 2:
            return Disc.rollout(self, state, commands)
        done = Disc.rollout(self, state, commands[:1])
        return Rollout([*done.states, done.states[-1]], 1, reason)

    return rollout


def changed(base=Disc, **attributes):
    """A system with some attributes and methods replaced, which pickles by value."""
    return type("Changed", (base,), {"__reduce__": by_value} | attributes)()


def by_value(self):
    kind = type(self)
    return joblib.wrap_non_picklable_objects(lambda: kind()), ()


class NumpyAnswers(Disc):
    """Whose attributes and answers are numpy's scalars."""

    reduced_dim = np.int64(2)
    configuration_dim = np.uint8(2)
    step_size = np.float32(0.1)
    bounds = np.array([[-1, -1], [1, 1]])

    def succeeded(self, state, goal, tolerance):
        return np.bool_(super().succeeded(state, goal, tolerance))


@pytest.mark.parametrize(
    "system",
    [
        Disc(),
        Odometer(),
        Turntable(),
        NumpyAnswers(),
        Shore(),
        changed(rollout=stopping_with(StopReason.CONSTRAINT)),
        changed(rollout=stopping_with(PotholeReason.POTHOLE)),
    ],
)
@pytest.mark.parametrize("seed", [0, 1])
def test_systems_that_keep_the_contract_pass(system, seed):
    check_system(system, random_state=seed)


class Unpicklable(Disc):
    def __init__(self):
        super().__init__()
        self.handle = lambda: None


class InPlace(Disc):
    def propagate(self, reduced, command):
        reduced += command
        return reduced, np.ones(len(reduced), dtype=bool)


class Restless(Disc):
    def __init__(self):
        super().__init__()
        self.rng = np.random.default_rng(0)

    def features(self, reduced, next_reduced):
        return reduced + self.rng.normal(size=reduced.shape)


class RestlessGoals(Restless):
    features = Disc.features

    def sample_problem(self, random_state=None):
        return Problem(np.array([0.9, 0.9]), self.rng.uniform(size=(1, 2)))


class OneByOne(Disc):
    def steer(self, reduced, configuration):
        return super().steer(reduced, configuration[:1])


class BatchDependent(Disc):
    def features(self, reduced, next_reduced):
        return reduced - reduced.mean(axis=0)


class Overshooting(Disc):
    def steer(self, reduced, configuration):
        return 3 * super().steer(reduced, configuration)


class Imprecise(Disc):
    def steer(self, reduced, configuration):
        return 0.5 * super().steer(reduced, configuration)


class Raising(Disc):
    def close(self, predicted, executed):
        raise KeyError("threshold")


class Wandering(Disc):
    def sample_configurations(self, rng, n):
        return super().sample_configurations(np.random.default_rng(), n)


class Narrow(Disc):
    def sample_configurations(self, rng, n):
        return super().sample_configurations(rng, n)[:, :1]


class Silent(Disc):
    def rollout(self, state, commands):
        rollout = super().rollout(state, commands)
        return Rollout(rollout.states[1:], rollout.n_completed, rollout.stop_reason)


class Late(Disc):
    """Whose rollout starts with the second state."""

    def rollout(self, state, commands):
        states = super().rollout(state, commands).states
        states = [*states[1:], states[-1]]
        return Rollout(states, len(commands), StopReason.COMPLETED)


class Pessimist(Disc):
    def rollout(self, state, commands):
        rollout = super().rollout(state, commands)
        return Rollout(rollout.states, rollout.n_completed, StopReason.CONSTRAINT)


class Optimist(Disc):
    def rollout(self, state, commands):
        rollout = super().rollout(state, commands)
        return Rollout(rollout.states[:1], 0, StopReason.COMPLETED)


class Eager(Disc):
    """Whose rollout moves without a command."""

    def rollout(self, state, commands):
        if len(commands):
            return super().rollout(state, commands)
        return Rollout([state, state], 0, StopReason.CONSTRAINT)


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"reduced_dim": 0}, "reduced_dim must be a positive integer, got 0"),
        ({"reduced_dim": True}, "reduced_dim must be a positive integer, got True"),
        ({"configuration_dim": 2.0}, "configuration_dim must be a positive integer, got 2.0"),
        ({"configuration_dim": 3}, "configuration_dim must be at most reduced_dim = 2"),
        ({"step_size": np.inf}, "step_size must be a positive number, got inf"),
        ({"step_size": 0}, "step_size must be a positive number, got 0"),
        ({"step_size": "1"}, "step_size must be a positive number, got '1'"),
        ({"bounds": np.zeros((2, 3))}, r"bounds must be a numpy array of shape \(2, 2\).*\(2, 3\)"),
        ({"bounds": np.zeros((2, 2))}, "bounds must be finite, lower < upper"),
        ({"bounds": np.array([[0, 0], [1, np.inf]])}, "bounds must be finite, lower < upper"),
        ({"bounds": np.array([["0", "0"], ["1", "1"]])}, "bounds must be a numpy array"),
        ({"bounds": [[-1.0, -1.0], [1.0, 1.0]]}, r"bounds must be a numpy array .* got \[\[-1.0"),
        ({"bounds": None}, "bounds must be a numpy array .* got None"),
    ],
)
def test_wrong_attributes_are_named(attributes, message):
    with pytest.raises(SystemContractError, match=rf"^Changed\.{message}"):
        check_system(changed(**attributes))


@pytest.mark.parametrize("angular", [[0], (2,), (-1,), (0, 0), (0.0,), (True,), 0])
def test_wrong_indices_of_angles_are_named(angular):
    with pytest.raises(SystemContractError, match="angular must be a tuple of different indices"):
        check_system(changed(angular=angular))


def test_angles_have_bounds_of_one_turn():
    bounds = np.array([[-4.0, -1.0], [np.pi, 1.0]])
    with pytest.raises(SystemContractError, match=r"bounds must lie in \[-π, π\] for angles, got"):
        check_system(changed(Turntable, bounds=bounds))


def test_angles_that_the_model_leaves_unwrapped_are_named():
    def propagate(self, reduced, command):
        return reduced + command, np.ones(len(reduced), dtype=bool)

    with pytest.raises(SystemContractError, match=r"propagate must return angles in \[-π, π\)"):
        check_system(changed(Turntable, propagate=propagate))


@pytest.mark.parametrize(
    ("system", "message"),
    [
        (object(), "must be a System"),
        (Unpicklable(), "does not pickle .* Leave simulators"),
        (Wandering(), "sample_configurations must draw from nothing but the given"),
        (Narrow(), r"sample_configurations must return an array of shape \(16, 2\)"),
        (
            changed(sample_configurations=lambda s, r, n: r.uniform(1, 2, (n, 2))),
            r"sample_configurations left the bounds: \[\[1.",
        ),
        (
            changed(sample_configurations=lambda s, r: None),
            "sample_configurations raised TypeError",
        ),
        (changed(sample_problem=lambda s, r: (0, 1)), "sample_problem must return a Problem"),
        (RestlessGoals(), "sample_problem gave two results for the same arguments"),
        (changed(reduce=lambda s, x: x[:1]), r"reduce must return an array of shape \(2,\)"),
        (changed(reduce=lambda s, x: x * np.nan), "reduce returned NaN or infinity"),
        (changed(reduce=lambda s, x: np.float32(x)), "reduce must return a float64 array"),
        (changed(reduce=lambda s, x: [0.0, 0.0]), "reduce must return a float64 array, got list"),
    ],
)
def test_breaches_of_attributes_and_drawing_are_named(system, message):
    with pytest.raises(SystemContractError, match=message):
        check_system(system)


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        (
            np.zeros(2),
            r"a goal that is an array of shape \(n_goals, 2\) or a GoalRegion, got array\(\[0",
        ),
        (np.zeros((1, 3)), "a goal that is an array of shape"),
        (np.zeros((0, 2)), "a goal that is an array of shape"),
        ([[0.0, 0.0]], "a goal that is an array of shape"),
        (np.array([[0.0, 0.0], [0.0, 1.5]]), r"sample_problem returned a goal out of bounds: \[\["),
    ],
)
def test_goals_are_configurations_within_bounds(goal, message):
    problem = Problem(np.array([0.9, 0.9]), goal)
    with pytest.raises(SystemContractError, match=message):
        check_system(changed(sample_problem=lambda s, r: problem))


@pytest.mark.parametrize(
    ("system", "message"),
    [
        (changed(steer=lambda s, b, q: q[0]), r"steer must return one command per row.*got \(2,\)"),
        (changed(steer=lambda s, b, q: q[:3]), r"steer must return one command per row.*\(3, 2\)"),
        (changed(steer=lambda s, b, q: q.astype("f")), "steer must return a float64 array"),
        (OneByOne(), "steer gives other results for rows alone than in a batch"),
        (Overshooting(), "steer commanded a motion of 0.3, more than step_size = 0.1"),
        (Imprecise(), "steer misses a configuration within one step"),
        (InPlace(), "propagate changed its arguments in place"),
        (changed(propagate=lambda s, b, u: b + u), r"must return \(next_reduced, valid\)"),
        (
            changed(propagate=lambda s, b, u: ((b + u)[:, :1], np.ones(len(b), bool))),
            r"propagate must return next_reduced of shape \(16, 2\), got \(16, 1\)",
        ),
        (
            changed(propagate=lambda s, b, u: ((b + u).tolist(), np.ones(len(b), bool))),
            "propagate must return next_reduced of shape",
        ),
        (
            changed(propagate=lambda s, b, u: (b + u, np.ones(len(b)))),
            r"propagate must return one bool per row, shape \(16,\), got float64 \(16,\)",
        ),
        (Raising(), "Raising.close raised KeyError: 'threshold'"),
        (changed(close=lambda s, p, e: True), "close must return one bool per row.* got True"),
        (changed(close=lambda s, p, e: np.zeros(len(p), bool)), "not close to itself"),
        (Restless(), "features gave two results for the same arguments"),
        (BatchDependent(), "features gives other results for rows alone"),
        (changed(features=lambda s, b, c: b[0]), "features must return a row per transition"),
        (changed(features=lambda s, b, c: b * np.inf), "features must return finite numbers"),
        (changed(features=lambda s, b, c: b.astype(str)), "features must return finite numbers"),
        (
            changed(features=lambda s, b, c: np.array(list(b))),
            r"features must answer zero rows with zero rows, an array of shape \(0, 2\), got \(0,",
        ),
    ],
)
def test_breaches_of_the_model_are_named(system, message):
    with pytest.raises(SystemContractError, match=message):
        check_system(system)


def test_walking_needs_a_model_that_carries_on():
    """The rest of the reduced state may change with every step, but is checked as well."""

    def propagate(self, reduced, command):
        following, valid = Odometer.propagate(self, reduced, command)
        return following * [1, 1, np.inf], valid

    with pytest.raises(SystemContractError, match="propagate returned NaN or infinity"):
        check_system(changed(Odometer, propagate=propagate))


@pytest.mark.parametrize(
    ("system", "message"),
    [
        (changed(rollout=lambda s, x, u: [x]), "rollout must return a Rollout, got"),
        (changed(rollout=stopping_with("a pothole")), "stop_reason that is .* got 'a pothole'"),
        (changed(rollout=stopping_with(PotholeReason.NUMBERED)), "whose value is a sentence, got"),
        (
            Pessimist(),
            r"rollout completed (\d) of \1 commands, which .* stop reason CONSTRAINT",
        ),
        (Optimist(), r"rollout completed 0 of \d commands, which .* stop reason COMPLETED"),
        (Silent(), r"rollout must return the start, one state per .*: \d states, got \d"),
        (Late(), "rollout must return the start state first"),
        (Eager(), "rollout of no commands must return the start state alone"),
        (changed(goal_reached=lambda s, b, g: 0), "goal_reached must return one bool per row"),
        (changed(succeeded=lambda s, x, g, t: False), "succeeded says False at an infinite"),
        (changed(succeeded=lambda s, x, g, t: None), "succeeded must return a bool, got None"),
    ],
)
def test_breaches_of_the_execution_are_named(system, message):
    with pytest.raises(SystemContractError, match=message):
        check_system(system)


def test_every_executed_state_must_reduce():
    def rollout(self, state, commands):
        done = Disc.rollout(self, state, commands)
        states = [*done.states[:-1], np.full(2, np.nan)] if len(commands) else done.states
        return Rollout(states, done.n_completed, done.stop_reason)

    with pytest.raises(SystemContractError, match="reduce returned NaN or infinity"):
        check_system(changed(rollout=rollout))


def test_rollouts_must_repeat():
    rng = np.random.default_rng(0)

    def rollout(self, state, commands):
        done = Disc.rollout(self, state, commands)
        states = [done.states[0], *(s + rng.normal(size=2) for s in done.states[1:])]
        return Rollout(states, done.n_completed, done.stop_reason)

    with pytest.raises(SystemContractError, match="rollout gave two results"):
        check_system(changed(rollout=rollout))


SOMEWHERE = np.array([0.9, 0.9])


@pytest.mark.parametrize(
    "parts", [5, [slice(0, 1)], (1,), (slice(0, 3),), (slice(1, 1),), (slice(0.0, 1.0),), None]
)
def test_parts_that_are_no_slices_of_the_configuration_are_named(parts):
    with pytest.raises(SystemContractError, match="independent_parts must be a tuple of slices of"):
        check_system(changed(independent_parts=parts))


@pytest.mark.parametrize(
    "parts", [(), (slice(0, 1), slice(1, 2)), (slice(None),), (slice(-1, None),)]
)
def test_parts_of_the_configuration_pass(parts):
    check_system(changed(independent_parts=parts))


def never_valid(self, reduced, command):
    return np.full_like(reduced, np.nan), np.zeros(len(reduced), dtype=bool)


def never_moving(self, reduced, command):
    return reduced.copy(), Disc.propagate(self, reduced, command)[1]


def counting(self, reduced, command):
    """An odometer that counts, and stays where it is."""
    return reduced + np.eye(3)[2], np.ones(len(reduced), dtype=bool)


def from_0_to_2_pi(self, state):
    return np.array([state[0] % (2 * np.pi), state[1]])


def problem_from(*start):
    return lambda self, random_state=None: Problem(np.array(start), SOMEWHERE[None])


def now_and_then_in_the_obstacle(self, random_state=None):
    return Problem(np.array([0.1, 0.1]) if random_state == 2 else SOMEWHERE, SOMEWHERE[None])


def problem_to(*goals):
    return lambda self, random_state=None: Problem(SOMEWHERE, np.array(goals))


def ignores_commands(self, state, commands):
    """Drifts, whatever it is told."""
    states = state + 0.01 * np.arange(len(commands) + 1)[:, None]
    return Rollout(states, len(commands), StopReason.COMPLETED)


@pytest.mark.parametrize(
    ("system", "message"),
    [
        (
            changed(propagate=never_valid),
            "propagate was valid for none of 256 transitions .*starts",
        ),
        (changed(propagate=never_moving), r"propagate moved .* in none of \d+ valid transitions"),
        (
            changed(Odometer, propagate=counting),
            r"propagate moved .* in none of 256 valid transiti",
        ),
        (
            changed(Turntable, reduce=from_0_to_2_pi),
            r"reduce must return angles in \[-π, π\), got .*; systems.wrap_columns",
        ),
        (
            changed(sample_problem=problem_from(0.1, 0.1)),
            "propagate was valid for none .* are the starts in an obstacle",
        ),
        (
            changed(sample_problem=now_and_then_in_the_obstacle),
            "sample_problem of random_state=2 returned a start at which propagate is not valid",
        ),
        (
            changed(sample_problem=problem_to([0.1, 0.1], [0.2, 0.0])),
            "sample_problem of random_state=0 returned goals at which propagate .* all 2, such as",
        ),
        (changed(rollout=ignores_commands), "rollout ended in the same state .* in all 4 trials"),
        (
            changed(close=lambda s, p, e: np.ones(len(p), bool)),
            r"close says True in all \d+ trials with different reduced states, .* up to .* apart",
        ),
        (
            changed(Odometer, close=lambda s, p, e: np.ones(len(p), bool)),
            r"close says True in all \d+ trials with different reduced states, .* up to .* apart",
        ),
        (
            changed(goal_reached=lambda s, b, g: np.ones(len(b), bool)),
            r"goal_reached says True in all \d+ trials, also of the starts of 4 problems",
        ),
        (
            changed(goal_reached=lambda s, b, g: np.zeros(len(b), bool)),
            r"goal_reached says False of the goal itself, \[.* allow for rounding",
        ),
    ],
)
def test_answers_that_never_vary_are_named(system, message):
    with pytest.raises(SystemContractError, match=message):
        check_system(system)


def test_one_goal_out_of_an_obstacle_is_enough():
    check_system(changed(sample_problem=problem_to([0.1, 0.1], [0.9, -0.9])))


def hardly_moving(self, state, commands):
    states = state + np.cumsum(np.vstack([np.zeros(2), 1e-9 * commands]), axis=0)
    return Rollout(states, len(commands), StopReason.COMPLETED)


def stuck(self, state, commands):
    completed = len(commands) == 0
    reason = StopReason.COMPLETED if completed else StopReason.CONSTRAINT
    return Rollout([state] * (1 if completed else 2), 0, reason)


@pytest.mark.parametrize(
    "system",
    [
        changed(rollout=hardly_moving),
        changed(rollout=stuck),
        changed(close=lambda s, p, e: np.linalg.norm(p - e, axis=1) < 1.5),
        changed(
            propagate=lambda s, b, u: (
                b + u,
                (np.linalg.norm(u, axis=1) < 0.02) | (u[:, 0] > 0.098),
            )
        ),
    ],
)
def test_systems_whose_answers_seldom_vary_pass(system):
    """Commands that hardly move, a rollout that stops at once, a wide Close, a narrow way."""
    check_system(system)


class Singular:
    """Divides by the number of rows."""

    def __init__(self, method):
        self.method = method

    def __call__(self, system, first, *rest):
        len(first) or 1 / 0
        return getattr(Disc, self.method)(system, first, *rest)


@pytest.mark.parametrize("method", ["propagate", "steer", "close", "features", "goal_reached"])
def test_methods_that_fail_for_zero_rows_are_told_so(method):
    def singular(self, first, *rest):
        return Singular(method)(self, first, *rest)

    expected = (
        rf"{method} raised ZeroDivisionError for zero rows, .* answer zero rows with zero rows"
    )
    with pytest.raises(SystemContractError, match=expected):
        check_system(changed(**{method: singular}))


def of_zero_rows(method, answer):
    def wrong(self, first, *rest):
        return getattr(Disc, method)(self, first, *rest) if len(first) else answer

    return changed(**{method: wrong})


@pytest.mark.parametrize(
    "system",
    [
        of_zero_rows("propagate", np.empty((0, 2))),
        of_zero_rows("propagate", (np.empty(0), np.empty(0, bool))),
        of_zero_rows("propagate", (np.empty((0, 2)), np.empty((0, 1), bool))),
        of_zero_rows("steer", np.empty((1, 2))),
        of_zero_rows("close", True),
        of_zero_rows("features", np.empty((0, 3))),
        of_zero_rows("goal_reached", np.ones(1, bool)),
        changed(sample_configurations=lambda s, r, n: r.uniform(0, 1, (max(n, 1), 2))),
    ],
)
def test_zero_rows_are_answered_with_zero_rows(system):
    with pytest.raises(SystemContractError, match="must answer zero rows with zero rows"):
        check_system(system)


class Forgetful(Disc):
    """Whose pickles forget how far it moves."""

    def __init__(self, pace=1.0):
        super().__init__(sticky=False)
        self.pace = pace

    def __getstate__(self):
        return {"pace": 1.0, "sticky": False}

    def rollout(self, state, commands):
        return super().rollout(state, self.pace * commands)


class Narrowed(Disc):
    def __init__(self):
        super().__init__()
        self.bounds = np.array([[-1.0, -1.0], [1.0, 1.5]])

    def __getstate__(self):
        return {"sticky": True}


class Lost(Disc):
    """Whose copies lack an attribute."""

    def __getstate__(self):
        return {}


@pytest.mark.parametrize(
    ("system", "message"),
    [
        (
            Forgetful(0.9),
            r"Forgetful.rollout is .*, and that of a pickled copy .*: it is another sy",
        ),
        (Narrowed(), r"Narrowed.bounds is .*1.5.*, and that of a pickled copy .* __getstate__"),
        (Lost(), "a pickled copy of it does not: AttributeError: .*sticky.* __getstate__"),
    ],
)
def test_copies_that_are_another_system_are_named(system, message):
    with pytest.raises(SystemContractError, match=message):
        check_system(system)


SIMULATORS = {}


class Connected(Disc):
    """Holds the number of a simulator that only this process knows, as PyBullet clients are."""

    def __init__(self):
        super().__init__()
        self.client = len(SIMULATORS)
        SIMULATORS[self.client] = "running"

    def rollout(self, state, commands):
        if self.client not in SIMULATORS:
            raise RuntimeError("Not connected to physics server.")
        return super().rollout(state, commands)


def test_simulators_of_this_process_are_told_of_pickling_and_of_connecting_late():
    expected = (
        "Connected works, but a pickled copy of it in another process does not: RuntimeError: Not "
        "connected to physics server.* pickled.* connect a simulator when a rollout first needs one"
    )
    with pytest.raises(SystemContractError, match=expected):
        check_system(Connected())


class Crashing(Connected):
    """Whose simulator takes the process with it."""

    def rollout(self, state, commands):
        if self.client not in SIMULATORS:
            os._exit(1)
        return super().rollout(state, commands)


def test_a_copy_that_ends_its_process_is_named():
    with pytest.raises(SystemContractError, match="in another process does not: Terminated"):
        check_system(Crashing())


def test_a_class_that_no_other_process_can_import_is_checked_here(monkeypatch):
    module = types.ModuleType("made_in_this_process")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    exec("from toy_systems import Disc\n\nclass Local(Disc): pass", vars(module))
    check_system(module.Local())


class Far(RightOf):
    def distance(self, configurations):
        return 1 + super().distance(configurations)


class Unseeded(RightOf):
    def sample(self, rng, n):
        return super().sample(np.random.default_rng(), n)


class Outside(RightOf):
    def sample(self, rng, n):
        return np.full((n, 2), 3.0)


class Many(RightOf):
    def sample(self, rng, n):
        return super().sample(rng, 2 * n)


class Scalar(RightOf):
    def distance(self, configurations):
        return 0.0


@pytest.mark.parametrize(
    ("region", "message"),
    [
        (Far(0.5), "Far.distance must be 0 for what sample drew"),
        (Unseeded(0.5), "Unseeded.sample must draw from nothing but the given generator"),
        (Outside(0.5), "Outside.sample drew nothing within the system's bounds in 16 draws"),
        (Many(0.5), r"Many.sample must return an array of shape \(16, 2\), got \(32, 2\)"),
        (Scalar(0.5), "Scalar.distance must return a float64 array, got float"),
    ],
)
def test_breaches_of_goal_regions_are_named(region, message):
    with pytest.raises(SystemContractError, match=message):
        check_system(changed(sample_problem=lambda s, r: Problem(SOMEWHERE, region)))
