"""Checks of what an estimator returned, so that a wrong answer is not taken for a right one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

# By how much rounding may take a probability out of [0, 1].
ROUNDING = 1e-6
# By how much half precision may change the sum of a row's probabilities.
_ROUNDING_OF_SUMS = 0.01


def one_per_row(returned: Any, n_rows: int, source: str) -> NDArray[Any]:
    """Return an estimator's answers as an array of shape (n_rows,); a column is taken as one.

    Parameters
    ----------
    returned : array-like of shape (n_rows,) or (n_rows, 1)
    n_rows : int
    source : str
        The estimator and its method, for the message.

    Raises
    ------
    ValueError
        If the shape is another one.
    """
    answers = np.asarray(returned)
    if answers.shape == (n_rows,):
        return answers
    if answers.shape == (n_rows, 1):
        return answers[:, 0]
    raise ValueError(
        f"{source} must return one answer for each of {n_rows} rows, got an array of shape "
        f"{answers.shape}."
    )


def check_numbers(scores: NDArray[Any], source: str) -> None:
    """Raise ``ValueError`` unless an estimator's answers are numbers, and none of them NaN."""
    if scores.dtype.kind not in "fiub":
        raise ValueError(f"{source} must return numbers, got an array of {scores.dtype}.")
    # A sum of squares is NaN only if a number is, and quicker than looking at each of a few.
    if math.isnan(np.vdot(scores, scores)):
        n_missing = int(np.count_nonzero(np.isnan(scores)))
        raise ValueError(
            f"{source} returned NaN in {n_missing} of {scores.size} places; look for NaN among the "
            "features, or for an estimator whose training diverged."
        )


def is_label(
    returned: Any, label: Any, classes: list[Any], n_rows: int, source: str
) -> NDArray[np.bool_]:
    """Say for each row whether the label that an estimator predicted is a certain one.

    Parameters
    ----------
    returned : array-like of shape (n_rows,) or (n_rows, 1)
    label : object
        One of the classes.
    classes : list
    n_rows : int
    source : str
        The estimator and its method, for the message.

    Returns
    -------
    equal : ndarray of bool of shape (n_rows,)

    Raises
    ------
    ValueError
        If there are labels that are not among the classes, or not one per row.
    """
    predicted = one_per_row(returned, n_rows, source)
    equal = np.zeros((len(classes), n_rows), dtype=np.bool_)
    for i, known in enumerate(classes):
        equal[i] = predicted == known
    foreign = ~equal.any(axis=0)
    if foreign.any():
        examples = list(dict.fromkeys(predicted[foreign].tolist()))[:3]
        raise ValueError(
            f"{source} must return labels from classes_, which is {classes}, and returned "
            f"{', '.join(map(repr, examples))}."
        )
    return equal[classes.index(label)]


def column_of_probabilities(
    returned: Any, column: int, n_classes: int, n_rows: int, source: str
) -> NDArray[np.float64]:
    """Return one class's probabilities, shape (n_rows,).

    Parameters
    ----------
    returned : array-like of shape (n_rows, n_classes)
    column, n_classes, n_rows : int
    source : str
        The estimator and its method, for the message.

    Raises
    ------
    ValueError
        If the shape is another one, or the values are not probabilities.
    """
    table = np.asarray(returned)
    if table.shape != (n_rows, n_classes) or table.dtype.kind not in "fiub":
        raise ValueError(
            f"{source} must return a column of numbers for each of {n_classes} classes and a row "
            f"for each of {n_rows} transitions, got an array of {table.dtype} of shape "
            f"{table.shape}."
        )
    probability = table[:, column].astype(np.float64)
    fit = (table >= -ROUNDING) & (table <= 1 + ROUNDING)
    if not fit.all():
        raise ValueError(
            f"{source} must return probabilities between 0 and 1, and returned {table[~fit][0]}."
        )
    sums = table.sum(axis=1)
    adds_up = np.abs(sums - 1) <= _ROUNDING_OF_SUMS
    if not adds_up.all():
        raise ValueError(
            f"{source} must return probabilities that add up to 1, and returned some that add up "
            f"to {sums[~adds_up][0]:.4g}."
        )
    return probability.clip(0.0, 1.0)
