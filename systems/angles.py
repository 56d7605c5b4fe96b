"""Angles in radians, for which -π and π are the same: brought to [-π, π), and subtracted."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.compilation import compiled
from systems.validation import as_numbers, is_integer

Array = NDArray[np.float64]
TURN = 2 * np.pi


@compiled
def wrap_angle(angle: float) -> float:
    """Return an angle plus the multiple of 2π that brings it to [-π, π)."""
    if -np.pi <= angle < np.pi:
        return angle
    # At the ends of the range, rounding can lead out of it.
    wrapped = angle - TURN * np.floor((angle + np.pi) / TURN)
    return wrapped if -np.pi <= wrapped < np.pi else -np.pi


def wrap_columns(rows: Array, angular: tuple[int, ...]) -> Array:
    """Bring the columns that hold angles to [-π, π).

    Parameters
    ----------
    rows : ndarray of shape (..., d)
    angular : tuple of int
        Indices along the last axis.

    Returns
    -------
    wrapped : ndarray of shape (..., d)
        A copy, or ``rows`` itself if there are no angles.
    """
    if isinstance(angular, tuple) and not angular:
        return rows
    wrapped = np.array(as_numbers(rows, "rows"), order="C")
    _check_angular(angular, wrapped.shape)
    if wrapped.size:
        _wrap_in_place(wrapped.reshape(-1, wrapped.shape[-1]), angular)
    return wrapped


def _check_angular(angular: Any, shape: tuple[int, ...]) -> None:
    """Raise ``ValueError`` unless compiled code finds all columns, which it doesn't check."""
    d = shape[-1] if shape else 0
    if not isinstance(angular, tuple) or not all(is_integer(i) and -d <= i < d for i in angular):
        raise ValueError(
            "angular must be a tuple of indices along the last axis of rows, of the shape "
            f"{shape}, got {angular!r}."
        )


@compiled
def _wrap_in_place(rows: Array, angular: tuple[int, ...]) -> None:
    for row in range(rows.shape[0]):
        for i in angular:
            rows[row, i] = wrap_angle(rows[row, i])


def shortest_way(starts: Array, ends: Array, angular: tuple[int, ...]) -> Array:
    """Return ``ends - starts``, for angles along the shorter way around the circle.

    Parameters
    ----------
    starts, ends : ndarray of shape (..., d)
    angular : tuple of int
        Indices along the last axis of the columns that hold angles.

    Returns
    -------
    way : ndarray of shape (..., d)
        Angles in [-π, π).
    """
    begins, stops = as_numbers(starts, "starts"), as_numbers(ends, "ends")
    try:
        way = stops - begins
    except ValueError:
        raise ValueError(
            "starts and ends must have shapes that go together, got "
            f"{begins.shape} and {stops.shape}."
        ) from None
    return wrap_columns(way, angular)
