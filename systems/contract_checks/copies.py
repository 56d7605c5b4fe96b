"""Checks that a system pickles, and that its copy is the same system, in other processes too."""

from __future__ import annotations

import pickle
from concurrent.futures.process import BrokenProcessPool
from typing import Any

import joblib
import numpy as np

from systems.errors import SystemContractError
from systems.system import Array, Problem, System

# What rounding may change from one process to another.
TOLERANCE = 1e-6
_REMEDY = (
    "Data are collected in other processes (n_jobs), to which the system is pickled. Leave "
    "simulators and other handles out of __getstate__, keep all else in it, and start or connect "
    "a simulator when a rollout first needs one, not in __init__: a PyBullet client, for one, is "
    "not connected in any other process."
)


def check_pickles(system: System) -> None:
    """Check that a system pickles."""
    try:
        pickle.dumps(system)
    except Exception as error:
        raise SystemContractError(
            f"{type(system).__name__} does not pickle ({error}). {_REMEDY}"
        ) from error


def check_copies(system: System, problem: Problem, commands: Array, seed: int) -> None:
    """Check that pickled copies, here and in another process, answer as the system does."""
    expected = _answers(system, problem, commands, seed)
    _compare(system, expected, _answers_of_copy(system, problem, commands, seed), "a pickled copy")
    elsewhere = _answers_elsewhere(system, problem, commands, seed)
    if elsewhere is not None:
        _compare(system, expected, elsewhere, "a pickled copy in another process")


def _answers(system: System, problem: Problem, commands: Array, seed: int) -> dict[str, Any]:
    """Return what a system answers, by the name of the attribute or the method."""
    reduced = system.reduce(problem.start)[None]
    command = system.steer(reduced, system.bounds[:1])
    following, valid = system.propagate(reduced, command)
    states = system.rollout(problem.start, commands).states
    return {
        "reduced_dim": system.reduced_dim,
        "configuration_dim": system.configuration_dim,
        "step_size": system.step_size,
        "bounds": system.bounds,
        "angular": system.angular,
        "sample_problem": system.reduce(system.sample_problem(seed).start),
        "reduce": reduced,
        "steer": command,
        "propagate": (valid, following[valid]),
        "close": system.close(reduced, reduced),
        "features": system.features(reduced, reduced),
        "rollout": np.array([system.reduce(state) for state in states]),
    }


def _answers_of_copy(
    system: System, problem: Problem, commands: Array, seed: int
) -> dict[str, Any]:
    try:
        return _answers(pickle.loads(pickle.dumps(system)), problem, commands, seed)
    except Exception as error:
        raise SystemContractError(
            f"{type(system).__name__} works, but a pickled copy of it does not: "
            f"{_told(error)}. {_REMEDY}"
        ) from error


def _answers_elsewhere(
    system: System, problem: Problem, commands: Array, seed: int
) -> dict[str, Any] | None:
    """Return the answers of a copy in another process; None where that can't import its class."""
    task = joblib.delayed(_answers)(system, problem, commands, seed)
    try:
        answers: dict[str, Any] = joblib.Parallel(n_jobs=2, backend="loky")([task])[0]
    except Exception as error:
        if isinstance(error, BrokenProcessPool) and error.__cause__ is not None:
            return None
        raise SystemContractError(
            f"{type(system).__name__} works, but a pickled copy of it in another process does "
            f"not: {_told(error)}. {_REMEDY}"
        ) from error
    return answers


def _told(error: Exception) -> str:
    return f"{type(error).__name__}: {error}".rstrip(".")


def _compare(system: System, expected: dict[str, Any], answers: dict[str, Any], whose: str) -> None:
    for name, value in expected.items():
        if not _alike(value, answers[name]):
            raise SystemContractError(
                f"{type(system).__name__}.{name} is {_shown(value)}, and that of {whose} "
                f"{_shown(answers[name])}: it is another system. {_REMEDY}"
            )


def _alike(one: Any, other: Any) -> bool:
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(_alike, one, other))
    if np.shape(one) != np.shape(other):
        return False
    return np.allclose(one, other, rtol=TOLERANCE, atol=TOLERANCE)


def _shown(value: Any) -> str:
    value = value[-1] if isinstance(value, tuple) and value else value
    shown = np.array2string(np.asarray(value), threshold=8, edgeitems=2, separator=", ")
    return " ".join(shown.split())
