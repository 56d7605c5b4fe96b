"""Compiled comparison of elastic bands: how near they are, and whether obstacles part them."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.band.row_kernels import resample_row
from systems.rope.obstacles.signed_distance_kernels import distance

# A segment that is nearer to an obstacle than this, in metres, counts as touching it.
CONTACT = 1e-4


@compiled
def square_distance(points: Any, others: Any) -> float:
    """Sum of the squared distances of matched points."""
    total = 0.0
    for i in range(points.shape[0]):
        x, y = points[i, 0] - others[i, 0], points[i, 1] - others[i, 1]
        z = points[i, 2] - others[i, 2]
        total += x * x + y * y + z * z
    return total


@compiled
def segment_free(p: Any, q: Any, length: float, clearance: float, packed: Any) -> bool:
    """March along a segment from p to q in steps as long as the distance to the obstacles.

    ``clearance`` is a lower bound of that distance at p.
    """
    t = clearance
    while t < length:
        ratio = t / length
        d = distance(
            p[0] + ratio * (q[0] - p[0]),
            p[1] + ratio * (q[1] - p[1]),
            p[2] + ratio * (q[2] - p[2]),
            packed,
        )
        if d < CONTACT:
            return False
        t += d
    return True


@compiled
def segments_free(points: Any, others: Any, packed: Any) -> bool:
    """Say whether every segment between matched points is free of obstacles."""
    clearance = -1.0
    for i in range(points.shape[0]):
        p, q = points[i], others[i]
        length = np.sqrt((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2 + (q[2] - p[2]) ** 2)
        if i > 0:
            # From point to point, the distance changes by no more than the step between them.
            before = points[i - 1]
            clearance -= np.sqrt(
                (p[0] - before[0]) ** 2 + (p[1] - before[1]) ** 2 + (p[2] - before[2]) ** 2
            )
        if clearance <= length:
            clearance = distance(p[0], p[1], p[2], packed)
            if clearance < CONTACT or not segment_free(p, q, length, clearance, packed):
                return False
    return True


@compiled
def compare_bands(bands: Any, others: Any, packed: Any, n_matched: int, max_distance: float) -> Any:
    """Say, row by row, whether bands are near one another and no obstacle is between them.

    Parameters
    ----------
    bands, others : ndarray of shape (n, reduced_dim)
    packed : ndarray of shape (n_rows, 8)
    n_matched : int
        Points, evenly spaced along each band, that are compared one to one.
    max_distance : float
        Largest Euclidean norm of all their differences together, metres.

    Returns
    -------
    close : ndarray of bool of shape (n,)
    """
    close = np.empty(bands.shape[0], np.bool_)
    points, other_points = np.empty((n_matched, 3)), np.empty((n_matched, 3))
    for i in range(bands.shape[0]):
        resample_row(bands[i], points)
        resample_row(others[i], other_points)
        near = square_distance(points, other_points) < max_distance * max_distance
        close[i] = near and segments_free(points, other_points, packed)
    return close
