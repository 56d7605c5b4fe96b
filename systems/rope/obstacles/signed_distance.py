"""Exact signed distances from points to the obstacles of a scene."""

from __future__ import annotations

import numpy as np

from systems.rope.obstacles.shapes import Array
from systems.rope.obstacles.signed_distance_kernels import fill_distances


def signed_distance(points: Array, packed: Array) -> Array:
    """Distance of points to the nearest obstacle, negative inside one.

    It is exact outside the obstacles, and inside where they do not overlap. Where they do, it is
    the depth in the obstacle in which the point lies deepest. Without obstacles it is 1e9.

    Parameters
    ----------
    points : ndarray of shape (..., 3)
        Metres, world frame.
    packed : ndarray of shape (n_rows, 8)
        From :func:`systems.rope.obstacles.packing.pack_obstacles`.

    Returns
    -------
    distances : ndarray of shape (...)
        Metres.
    """
    rows = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    distances = np.empty(len(rows))
    fill_distances(rows, packed, distances)
    return distances.reshape(np.shape(points)[:-1])
