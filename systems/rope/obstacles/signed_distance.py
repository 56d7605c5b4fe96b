"""Exact signed distances from points to the obstacles of a scene."""

from __future__ import annotations

import numpy as np

from systems.rope.obstacles.shapes import Array
from systems.rope.obstacles.signed_distance_kernels import (
    fill_distances,
    fill_distances_and_gradients,
)


def signed_distance(points: Array, packed: Array) -> Array:
    """Distance of points to the nearest obstacle, negative inside one.

    Outside it is exact. Inside it is the depth in the obstacle in which the point lies
    deepest, which is exact where obstacles do not overlap. Without obstacles it is 1e9.

    Parameters
    ----------
    points : ndarray of shape (..., 3)
        Metres, world frame.
    packed : ndarray of shape (n, 8)
        From :func:`systems.rope.obstacles.shapes.pack_obstacles`.

    Returns
    -------
    distances : ndarray of shape (...)
        Metres.
    """
    rows = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    distances = np.empty(len(rows))
    fill_distances(rows, packed, distances)
    return distances.reshape(np.shape(points)[:-1])


def signed_distance_and_gradient(points: Array, packed: Array) -> tuple[Array, Array]:
    """Distance of points to the nearest obstacle, and the direction in which it grows.

    Parameters
    ----------
    points : ndarray of shape (..., 3)
    packed : ndarray of shape (n, 8)

    Returns
    -------
    distances : ndarray of shape (...)
    gradients : ndarray of shape (..., 3)
        Unit vectors, those of the nearest obstacle; zeros without obstacles.
    """
    rows = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    distances, gradients = np.empty(len(rows)), np.empty_like(rows)
    fill_distances_and_gradients(rows, packed, distances, gradients)
    shape = np.shape(points)
    return distances.reshape(shape[:-1]), gradients.reshape(shape)
