"""Columns of features that tell nothing, tell the same, or have an unfit size."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# Features should be of order one; networks bear a factor of 30 either way.
_TOO_LARGE, _TOO_SMALL = 30.0, 1 / 30


def constant_columns(X: NDArray[Any], ranges: NDArray[np.float64]) -> tuple[int, ...]:
    """Return the columns whose least value is the greatest, from ranges of shape (d, 2).

    Of bit-packed voxel grids (uint8) that is no fault, as most of their bytes are empty space:
    these have none, unless nothing varies at all.
    """
    constant = ranges[:, 0] == ranges[:, 1]
    if X.dtype == np.uint8 and not constant.all():
        return ()
    return tuple(np.flatnonzero(constant).tolist())


def duplicate_columns(X: NDArray[Any], constant: tuple[int, ...]) -> tuple[tuple[int, int], ...]:
    """Return pairs of equal columns, the first of its kind and a later one.

    Bit-packed voxel grids (uint8) have none: much of them is alike.
    """
    if X.dtype == np.uint8:
        return ()
    first: dict[bytes, int] = {}
    pairs = []
    for column in sorted(set(range(X.shape[1])) - set(constant)):
        # Adding 0 makes -0 the same as 0.
        earlier = first.setdefault((X[:, column] + 0.0).tobytes(), column)
        if earlier != column:
            pairs.append((earlier, column))
    return tuple(pairs)


def unscaled_columns(X: NDArray[Any], ranges: NDArray[np.float64]) -> tuple[int, ...]:
    """Return the columns that have large values or a small range, without the constant ones."""
    if X.dtype == np.uint8:
        return ()
    size = np.abs(ranges).max(axis=1)
    extent = ranges[:, 1] - ranges[:, 0]
    unfit = (extent > 0) & ((size > _TOO_LARGE) | (extent < _TOO_SMALL))
    return tuple(np.flatnonzero(unfit).tolist())
