"""Compiled resampling and comparison of elastic bands."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.band.propagation_kernels import n_points
from systems.rope.obstacles.signed_distance_kernels import distance

# Closer to an obstacle than this, a segment counts as touching it.
CONTACT = 1e-4


@compiled(inline="always")
def segment_length(row: Any, i: int) -> float:
    """Length of the segment that starts at a band's i-th point."""
    k = 6 + 3 * i
    x, y, z = row[k + 3] - row[k], row[k + 4] - row[k + 1], row[k + 5] - row[k + 2]
    return np.sqrt(x * x + y * y + z * z)


@compiled
def row_length(row: Any) -> float:
    """Length of the band in a row."""
    total = 0.0
    for i in range(n_points(row) - 1):
        total += segment_length(row, i)
    return total


@compiled
def resample_row(row: Any, points: Any) -> None:
    """Write points that are evenly spaced along the band, ends included."""
    n, m = n_points(row), points.shape[0]
    spacing = row_length(row) / (m - 1)
    i, start, length = 0, 0.0, segment_length(row, 0)
    for j in range(m):
        while i < n - 2 and j * spacing > start + length:
            start += length
            i += 1
            length = segment_length(row, i)
        ratio = min(1.0, (j * spacing - start) / length) if length > 0.0 else 0.0
        k = 6 + 3 * i
        for axis in range(3):
            points[j, axis] = row[k + axis] + ratio * (row[k + 3 + axis] - row[k + axis])


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
    """March along a segment in steps that the distance to the obstacles allows.

    ``clearance`` is a lower bound of the distance at ``p``.
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
            # The distance changes by no more than the step from point to point.
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
def compare_rows(
    rows: Any, others: Any, packed: Any, max_square: float, workspace: Any, close: Any
) -> None:
    """Write, row by row, whether bands are near one another and of one homotopy class."""
    for i in range(rows.shape[0]):
        resample_row(rows[i], workspace[0])
        resample_row(others[i], workspace[1])
        near = square_distance(workspace[0], workspace[1]) < max_square
        close[i] = near and segments_free(workspace[0], workspace[1], packed)


@compiled
def fill_lengths(rows: Any, lengths: Any) -> None:
    """Write the length of each row's band."""
    for i in range(rows.shape[0]):
        lengths[i] = row_length(rows[i])


@compiled
def fill_resampled(rows: Any, points: Any) -> None:
    """Write evenly spaced points of each row's band."""
    for i in range(rows.shape[0]):
        resample_row(rows[i], points[i])
