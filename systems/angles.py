"""Angles in radians, for which -π and π are the same: brought to [-π, π), and subtracted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.compilation import compiled

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
    if not angular:
        return rows
    wrapped = np.array(rows, order="C")
    _wrap_in_place(wrapped.reshape(-1, rows.shape[-1]), angular)
    return wrapped


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
    return wrap_columns(ends - starts, angular)
