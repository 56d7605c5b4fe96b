"""The check of rows that planners pass to the rope, thousands of times a second."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from systems.compilation import compiled
from systems.system import Array
from systems.validation import as_finite_array


def as_rows(rows: ArrayLike, name: str, width: int) -> Array:
    """Return finite float64 rows; those that are so already are returned as they are.

    The same as :func:`systems.validation.as_finite_array`, faster for few rows.

    Parameters
    ----------
    rows : array-like of shape (n, width)
    name : str
        The argument's name, for the message.
    width : int

    Raises
    ------
    ValueError
        If the shape differs, or a value is NaN, infinite or no number.
    """
    fits = getattr(rows, "ndim", 0) == 2 and rows.shape[1] == width  # type: ignore[union-attr]
    if fits and rows.dtype == np.float64 and all_finite(rows):  # type: ignore[union-attr]
        return rows  # type: ignore[return-value]
    return as_finite_array(rows, name, (None, width))


def as_row_pair(
    first: ArrayLike, second: ArrayLike, names: tuple[str, str], widths: tuple[int, int]
) -> tuple[Array, Array]:
    """Return two arrays of finite float64 rows that belong together; see :func:`as_rows`.

    Parameters
    ----------
    first, second : array-like of shape (n, width)
    names : tuple of str
        The arguments' names, for the message.
    widths : tuple of int

    Raises
    ------
    ValueError
        If one of them is no such array, or they differ in their number of rows.
    """
    rows, others = as_rows(first, names[0], widths[0]), as_rows(second, names[1], widths[1])
    if len(rows) != len(others):
        raise ValueError(
            f"{names[1]} must have as many rows as {names[0]}, {len(rows)}, got {len(others)}."
        )
    return rows, others


@compiled
def all_finite(rows: Any) -> bool:
    """Say whether rows hold no NaN and no infinity."""
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            if not np.isfinite(rows[i, k]):
                return False
    return True
