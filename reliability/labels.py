"""Labels of transitions: what a rollout says about a prediction."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.validation import as_finite_array

RELIABLE = 1
UNRELIABLE = 0


def label_transitions(
    predicted: ArrayLike, executed: ArrayLike, close: Callable[..., Any]
) -> NDArray[np.int64]:
    """Label the transitions of one plan by its execution: the paper's l, Eq. 3.

    A transition is Reliable if prediction and execution are close both before and after it.
    Where they had diverged before, and where the execution stopped before, it is Unreliable.

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
    agrees = np.zeros(len(plan), dtype=np.bool_)
    agrees[: len(rollout)] = _checked(close(plan[: len(rollout)], rollout), len(rollout))
    return np.where(agrees[:-1] & agrees[1:], RELIABLE, UNRELIABLE)


def _checked(answers: Any, n_rows: int) -> NDArray[np.bool_]:
    array = np.asarray(answers)
    if array.shape != (n_rows,) or array.dtype != np.bool_:
        raise ValueError(
            f"close must return one bool per row, shape ({n_rows},), "
            f"got {array.dtype} of shape {array.shape}."
        )
    return array
