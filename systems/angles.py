"""Angles that wrap: one representative in [-π, π), and the short way round."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.compilation import compiled

Array = NDArray[np.float64]
TURN = 2 * np.pi


@compiled
def wrap_angle(angle: float) -> float:
    """Return the same angle in [-π, π), itself if it is there already."""
    if -np.pi <= angle < np.pi:
        return angle
    wrapped = angle - TURN * np.floor((angle + np.pi) / TURN)
    return wrapped if wrapped < np.pi else -np.pi


def wrap_columns(rows: Array, angular: tuple[int, ...]) -> Array:
    """Return ``rows`` with the entries ``angular`` brought to [-π, π).

    Parameters
    ----------
    rows : ndarray of shape (..., d)
    angular : tuple of int
        Indices of the last axis.
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
    """Return ``ends - starts``, along the short way round in the entries ``angular``.

    Parameters
    ----------
    starts, ends : ndarray of shape (..., d)
    angular : tuple of int
        Indices of the last axis.
    """
    return wrap_columns(ends - starts, angular)
