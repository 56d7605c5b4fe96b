"""Labels of transitions: whether the execution confirmed a prediction."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.validation import as_finite_array

RELIABLE = 1
UNRELIABLE = 0


def label_transitions(
    predicted: ArrayLike, executed: ArrayLike, close: Callable[..., Any]
) -> NDArray[np.int64]:
    """Label the transitions of one plan by its execution: the paper's l, Eq. 3.

    A transition is Reliable if prediction and execution are close both before and after it. All
    others are Unreliable, among them those that begin after the execution had diverged from the
    plan or had stopped.

    Parameters
    ----------
    predicted : array-like of shape (T + 1, reduced_dim)
        The plan's reduced states.
    executed : array-like of shape (S, reduced_dim), 1 <= S <= T + 1
        The reduced states of the rollout, from the start to where it ended.
    close : callable
        Takes two arrays of shape (n, reduced_dim), returns (n,) bool; ``system.close``.

    Returns
    -------
    y : ndarray of int of shape (T,)
        RELIABLE or UNRELIABLE.

    Raises
    ------
    ValueError
        If the shapes don't fit, a value is not finite, or ``close`` returns anything but one
        bool per row.
    """
    plan = as_finite_array(predicted, "predicted", (None, None))
    rollout = as_finite_array(executed, "executed", (None, plan.shape[1]))
    if not 1 <= len(rollout) <= len(plan):
        raise ValueError(
            f"executed must have between 1 and {len(plan)} states, as many as predicted at most, "
            f"got {len(rollout)}."
        )
    _check_callable(close, "close")
    agrees = np.zeros(len(plan), dtype=np.bool_)
    agrees[: len(rollout)] = _one_bool_per_row(close(plan[: len(rollout)], rollout), rollout)
    return np.where(agrees[:-1] & agrees[1:], RELIABLE, UNRELIABLE)


class ExecutedTransitions(NamedTuple):
    """What g predicts from the states of an execution, and whether the execution agreed.

    Attributes
    ----------
    reduced : ndarray of shape (n, reduced_dim)
        r(x_t), where the system was when it was given a command.
    next_reduced : ndarray of shape (n, reduced_dim)
        g(r(x_t), u_t).
    y : ndarray of int of shape (n,)
        RELIABLE or UNRELIABLE.
    step : ndarray of int of shape (n,)
        Number t of the command.
    """

    reduced: NDArray[np.float64]
    next_reduced: NDArray[np.float64]
    y: NDArray[np.int64]
    step: NDArray[np.int64]


def label_executed_transitions(
    executed: ArrayLike,
    commands: ArrayLike,
    propagate: Callable[..., Any],
    close: Callable[..., Any],
) -> ExecutedTransitions:
    """Label each command of an execution from the state in which the system was given it.

    The transition from r(x_t) to g(r(x_t), u_t) is Reliable if its end is close to r(x_{t+1}).
    Unlike the labels of Eq. 3, these do not depend on what happened earlier in the plan.

    Commands for which g has no successor at r(x_t), the paper's ∅, are left out: there is no
    predicted state to describe to an estimator, and planners never ask about such transitions,
    because they don't make them.

    Parameters
    ----------
    executed : array-like of shape (S, reduced_dim), S >= 1
        The reduced states of the rollout: the start, one state per completed command, and the
        state at the boundary of a constraint if the rollout stopped there.
    commands : array-like of shape (T, command_dim), T >= S - 1
        Commands after the first S - 1 were not given to the system, and are ignored.
    propagate : callable
        Takes reduced states and commands, returns their successors and whether they are valid;
        ``system.propagate``.
    close : callable
        Takes two arrays of shape (n, reduced_dim), returns (n,) bool; ``system.close``.

    Returns
    -------
    transitions : ExecutedTransitions
        At most S - 1, in order.

    Raises
    ------
    ValueError
        If the shapes don't fit, a value is not finite, or ``propagate`` or ``close`` returns
        something else than one state or bool per row.
    """
    states = as_finite_array(executed, "executed", (None, None))
    given = as_finite_array(commands, "commands", (None, None))
    n_given = len(states) - 1
    if not 0 <= n_given <= len(given):
        raise ValueError(
            f"executed must have between 1 and {len(given) + 1} states, one more than commands at "
            f"most, got {len(states)}."
        )
    _check_callable(propagate, "propagate")
    _check_callable(close, "close")
    following, valid = propagate(states[:-1], given[:n_given])
    step = np.flatnonzero(_one_bool_per_row(valid, states[:-1], "propagate"))
    next_reduced = as_finite_array(
        np.asarray(following)[step], "propagate's successors", (len(step), states.shape[1])
    )
    agrees = _one_bool_per_row(close(next_reduced, states[step + 1]), step)
    y = np.where(agrees, RELIABLE, UNRELIABLE)
    return ExecutedTransitions(states[step], next_reduced, y, step)


def _check_callable(function: Any, name: str) -> None:
    if not callable(function):
        raise ValueError(f"{name} must be callable, as a system's is, got {function!r}.")


def _one_bool_per_row(answers: Any, rows: NDArray[Any], name: str = "close") -> NDArray[np.bool_]:
    array = np.asarray(answers)
    if array.shape != (len(rows),) or array.dtype != np.bool_:
        raise ValueError(
            f"{name} must return one bool per row, shape ({len(rows)},), "
            f"got {array.dtype} of shape {array.shape}."
        )
    return array
