"""A checker for systems that users write."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np

from systems.angles import shortest_way
from systems.errors import SystemContractError
from systems.system import Array, Problem, Rollout, StopReason, System

N_PROBLEMS = 4
N_ROWS = 16
ROUNDING = 1e-9


def check_system(system: System, *, random_state: int = 0) -> None:
    """Check that planners, data collection and estimators can use a system.

    Draws a few problems and walks from their starts towards random configurations, with the
    model and with the true execution.

    Parameters
    ----------
    system : System
    random_state : int, default=0

    Raises
    ------
    SystemContractError
        At the first breach; the message names the method, what it returned and what is expected.
    """
    _check_attributes(system)
    _check_pickles(system)
    _check_samples(system, random_state)
    problems = [_check_problem(system, random_state + i) for i in range(N_PROBLEMS)]
    starts = np.array([_check_reduce(system, problem.start) for problem in problems])
    rng = np.random.default_rng(random_state)
    reduced = starts[rng.integers(len(starts), size=N_ROWS)]
    targets = _draw(system, rng, N_ROWS)
    command = _check_steer(system, reduced, targets)
    next_reduced, valid = _check_propagate(system, reduced, command)
    _check_steps(system, reduced, next_reduced, valid)
    _check_close(system, reduced, next_reduced)
    _check_features(system, reduced, next_reduced)
    for problem in problems:
        commands = _walk(system, problem, rng)
        executed = _check_rollout(system, problem.start, commands)
        _check_goals(system, problem, executed)


def _fail(system: System, method: str, complaint: str) -> None:
    raise SystemContractError(f"{type(system).__name__}.{method} {complaint}")


def _call(system: System, method: str, *arguments: Any) -> Any:
    """Call a method twice on copies and demand equal results and untouched arguments."""
    function: Callable[..., Any] = getattr(system, method)
    before = copy.deepcopy(arguments)
    try:
        result = function(*arguments)
        again = function(*copy.deepcopy(before))
    except SystemContractError:
        raise
    except Exception as error:
        raise SystemContractError(
            f"{type(system).__name__}.{method} raised {type(error).__name__}: {error}"
        ) from error
    if not _same(arguments, before):
        _fail(system, method, "changed its arguments in place; it must work on a copy.")
    if not _same(result, again):
        _fail(system, method, "gave two results for the same arguments; it must be deterministic.")
    return result


def _same(one: Any, other: Any) -> bool:
    return pickle.dumps(one) == pickle.dumps(other) or _equal_values(one, other)


def _equal_values(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(_equal_values, one, other))
    if hasattr(one, "__dict__"):
        return _equal_values(list(vars(one).values()), list(vars(other).values()))
    return bool(np.all(one == other))


def _check_attributes(system: System) -> None:
    if not isinstance(system, System):
        raise SystemContractError(f"A system must be a subclass of System, got {system!r}.")
    for name in ("reduced_dim", "configuration_dim"):
        value = getattr(system, name, None)
        if not isinstance(value, int | np.integer) or value < 1:
            _fail(system, name, f"must be a positive integer, got {value!r}.")
    if system.configuration_dim > system.reduced_dim:
        _fail(
            system,
            "configuration_dim",
            f"must be at most reduced_dim = {system.reduced_dim}: the configuration is the leading "
            f"part of the reduced state; got {system.configuration_dim}.",
        )
    step = getattr(system, "step_size", None)
    if not isinstance(step, int | float | np.floating) or not 0 < step < np.inf:
        _fail(system, "step_size", f"must be a positive number, got {step!r}.")
    bounds = np.asarray(getattr(system, "bounds", None), dtype=object)
    if bounds.shape != (2, system.configuration_dim):
        _fail(
            system,
            "bounds",
            f"must be an array of shape (2, {system.configuration_dim}), lower limits above upper "
            f"ones, got the shape {bounds.shape}.",
        )
    low, high = np.asarray(system.bounds, dtype=float)
    if not (np.isfinite(low) & np.isfinite(high) & (low < high)).all():
        _fail(system, "bounds", f"must be finite, lower < upper, got {low} and {high}.")
    _check_angular(system)


def _check_angular(system: System) -> None:
    angular, dim = system.angular, system.configuration_dim
    indices = isinstance(angular, tuple) and all(isinstance(i, int | np.integer) for i in angular)
    if not indices or len(set(angular)) < len(angular) or not set(angular) <= set(range(dim)):
        _fail(
            system,
            "angular",
            f"must be a tuple of different indices from 0 to {dim - 1}, got {angular!r}.",
        )
    limits = system.bounds[:, list(angular)]
    if (np.abs(limits) > np.pi).any():
        _fail(
            system,
            "bounds",
            f"must lie in [-π, π] for angles that wrap, got {limits.tolist()}.",
        )


def _check_pickles(system: System) -> None:
    try:
        pickle.loads(pickle.dumps(system))
    except Exception as error:
        raise SystemContractError(
            f"{type(system).__name__} does not pickle ({error}); leave simulators and other "
            "handles out of __getstate__ and start them when they are first needed."
        ) from error


def _check_samples(system: System, seed: int) -> None:
    samples, again = (
        system.sample_configurations(np.random.default_rng(seed), N_ROWS) for _ in range(2)
    )
    _check_array(system, "sample_configurations", samples, (N_ROWS, system.configuration_dim))
    if not np.array_equal(samples, again):
        _fail(system, "sample_configurations", "must draw from nothing but the given generator.")
    low, high = system.bounds
    if not ((samples >= low) & (samples <= high)).all():
        _fail(system, "sample_configurations", f"left the bounds: {samples.tolist()}.")


def _check_problem(system: System, seed: int) -> Problem:
    problem = _call(system, "sample_problem", seed)
    if not isinstance(problem, Problem):
        _fail(system, "sample_problem", f"must return a Problem, got {problem!r}.")
    goal = problem.goal
    dim = system.configuration_dim
    fits = isinstance(goal, np.ndarray) and goal.ndim == 2 and goal.shape[1] == dim and len(goal)
    if not fits:
        _fail(
            system,
            "sample_problem",
            f"must return a goal that is an array of shape (n_goals, {dim}), got {goal!r}.",
        )
    low, high = system.bounds
    if not ((goal >= low) & (goal <= high)).all():
        _fail(system, "sample_problem", f"returned a goal out of bounds: {goal.tolist()}.")
    return problem


def _check_reduce(system: System, state: Any) -> Array:
    reduced = _call(system, "reduce", state)
    _check_array(system, "reduce", reduced, (system.reduced_dim,))
    return reduced


def _check_array(system: System, method: str, array: Any, shape: tuple[int, ...]) -> None:
    if not isinstance(array, np.ndarray) or array.dtype != np.float64:
        kind = getattr(array, "dtype", type(array).__name__)
        _fail(system, method, f"must return a float64 array, got {kind}.")
    if array.shape != shape:
        _fail(system, method, f"must return an array of shape {shape}, got {array.shape}.")
    if not np.isfinite(array).all():
        _fail(system, method, f"returned NaN or infinity: {array}.")


def _check_booleans(system: System, method: str, array: Any, n_rows: int) -> None:
    if not isinstance(array, np.ndarray) or array.dtype != np.bool_ or array.shape != (n_rows,):
        got = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else repr(array)
        _fail(system, method, f"must return one bool per row, shape ({n_rows},), got {got}.")


def _check_rowwise(system: System, method: str, *rows: Array) -> None:
    """Demand that a batch gives what its rows give one at a time."""

    def outputs(part: slice) -> tuple[Any, ...]:
        result = getattr(system, method)(*(array[part] for array in rows))
        return result if isinstance(result, tuple) else (result,)

    batch = outputs(slice(0, 3))
    alone = [outputs(slice(i, i + 1)) for i in range(min(3, len(rows[0])))]
    for whole, *parts in zip(batch, *alone, strict=True):
        if not np.allclose(whole, np.concatenate(parts), rtol=0, atol=ROUNDING):
            _fail(system, method, "gives other results for rows alone than in a batch.")


def _check_steer(system: System, reduced: Array, targets: Array) -> Array:
    command = _call(system, "steer", reduced, targets)
    if not isinstance(command, np.ndarray) or command.ndim != 2 or len(command) != len(reduced):
        shape = np.shape(command)
        _fail(system, "steer", f"must return one command per row, (n, command_dim), got {shape}.")
    _check_array(system, "steer", command, command.shape)
    _check_rowwise(system, "steer", reduced, targets)
    return command


def _check_propagate(system: System, reduced: Array, command: Array) -> tuple[Array, Any]:
    result = _call(system, "propagate", reduced, command)
    if not isinstance(result, tuple) or len(result) != 2:
        _fail(system, "propagate", f"must return (next_reduced, valid), got {result!r}.")
    next_reduced, valid = result
    _check_booleans(system, "propagate", valid, len(reduced))
    if np.shape(next_reduced) != reduced.shape:
        _fail(
            system,
            "propagate",
            f"must return next_reduced of shape {reduced.shape}, got {np.shape(next_reduced)}.",
        )
    _check_array(system, "propagate", next_reduced[valid], (valid.sum(), system.reduced_dim))
    angles = next_reduced[valid][:, list(system.angular)]
    if ((angles < -np.pi) | (angles >= np.pi)).any():
        _fail(system, "propagate", "must return angles that wrap in [-π, π).")
    if valid.any():
        _check_rowwise(system, "propagate", reduced[valid], command[valid])
    return next_reduced, valid


def _check_steps(system: System, reduced: Array, next_reduced: Array, valid: Any) -> None:
    moved = next_reduced[valid, : system.configuration_dim]
    configurations = reduced[valid, : system.configuration_dim]
    lengths = np.linalg.norm(shortest_way(configurations, moved, system.angular), axis=1)
    if (lengths > system.step_size * (1 + 1e-6)).any():
        _fail(
            system,
            "steer",
            f"commanded a motion of {lengths.max():.6g}, more than step_size = "
            f"{system.step_size:.6g}.",
        )
    there = system.steer(reduced[valid], moved)
    arrived, still_valid = system.propagate(reduced[valid], there)
    reached = arrived[still_valid, : system.configuration_dim]
    gap = np.abs(shortest_way(reached, moved[still_valid], system.angular))
    if (gap > 1e-6).any():
        _fail(
            system,
            "steer",
            f"misses a configuration within one step by {gap.max():.3g}; the command must lead "
            "to it exactly under propagate.",
        )


def _check_close(system: System, reduced: Array, next_reduced: Array) -> None:
    close = _call(system, "close", reduced, next_reduced)
    _check_booleans(system, "close", close, len(reduced))
    if not system.close(reduced, reduced).all():
        _fail(system, "close", "says that a reduced state is not close to itself.")


def _check_features(system: System, reduced: Array, next_reduced: Array) -> None:
    rows = _call(system, "features", reduced, next_reduced)
    if not isinstance(rows, np.ndarray) or rows.ndim != 2 or len(rows) != len(reduced):
        _fail(system, "features", f"must return a row per transition, got {np.shape(rows)}.")
    if rows.dtype.kind not in "fiub" or not np.isfinite(rows).all():
        _fail(system, "features", f"must return finite numbers, got {rows.dtype}: {rows[0]}.")
    _check_rowwise(system, "features", reduced, next_reduced)
    none = _call(system, "features", reduced[:0], next_reduced[:0])
    if np.shape(none) != (0, rows.shape[1]):
        _fail(
            system,
            "features",
            f"of no transitions must return an array of shape (0, {rows.shape[1]}), got "
            f"{np.shape(none)}.",
        )


def _draw(system: System, rng: np.random.Generator, n: int) -> Array:
    low, high = system.bounds
    return rng.uniform(low, high, size=(n, system.configuration_dim))


def _walk(system: System, problem: Problem, rng: np.random.Generator) -> Array:
    reduced = system.reduce(problem.start)[None]
    target = _draw(system, rng, 1)
    commands = []
    for _ in range(5):
        command = system.steer(reduced, target)
        reduced, valid = system.propagate(reduced, command)
        if not valid[0]:
            break
        commands.append(command[0])
    return np.reshape(commands, (len(commands), -1)) if commands else command[:0]


def _check_rollout(system: System, start: Any, commands: Array) -> Rollout:
    rollout = _call(system, "rollout", start, commands)
    if not isinstance(rollout, Rollout) or not isinstance(rollout.stop_reason, StopReason):
        _fail(system, "rollout", f"must return a Rollout with a StopReason, got {rollout!r}.")
    completed = rollout.stop_reason is StopReason.COMPLETED
    if completed != (rollout.n_completed == len(commands)):
        _fail(
            system,
            "rollout",
            f"completed {rollout.n_completed} of {len(commands)} commands, which does not go with "
            f"the stop reason {rollout.stop_reason.name}.",
        )
    expected = rollout.n_completed + (1 if completed else 2)
    if len(rollout.states) != expected:
        _fail(
            system,
            "rollout",
            f"must return the start, one state per completed command and the boundary state if it "
            f"stopped: {expected} states, got {len(rollout.states)}.",
        )
    if not _same(system.reduce(rollout.states[0]), system.reduce(start)):
        _fail(system, "rollout", "must return the start state first.")
    for state in rollout.states:
        _check_reduce(system, state)
    nothing = system.rollout(start, commands[:0])
    if nothing.n_completed != 0 or len(nothing.states) != 1:
        _fail(system, "rollout", "of no commands must return the start state alone.")
    return rollout


def _check_goals(system: System, problem: Problem, executed: Rollout) -> None:
    reduced = np.array([system.reduce(state) for state in executed.states])
    reached = _call(system, "goal_reached", reduced, problem.goal)
    _check_booleans(system, "goal_reached", reached, len(reduced))
    last = executed.states[-1]
    answers = [
        _call(system, "succeeded", last, problem.goal, tolerance) for tolerance in (1e-12, np.inf)
    ]
    if not all(isinstance(answer, bool | np.bool_) for answer in answers):
        _fail(system, "succeeded", f"must return a bool, got {answers[0]!r}.")
    if not answers[1]:
        _fail(system, "succeeded", "says False at an infinite tolerance.")
