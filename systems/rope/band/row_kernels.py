"""Compiled reading and writing of bands as rows of numbers.

A row holds gripper A, gripper B, and then the points of the band from A to B, each as x, y, z in
metres. The last point is repeated until the row is full.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled

# Entries before the first point of the band: the positions of both grippers.
GRIPPERS_WIDTH = 6

# Below this length, in metres, a segment has no direction to go along.
_LEAST_SEGMENT = 1e-12


@compiled(inline="always")
def offset_of_point(i: int) -> int:
    """Return where the i-th point of a band starts in its row."""
    return GRIPPERS_WIDTH + 3 * i


@compiled
def room_for_points(row: Any) -> int:
    """Return how many points a row can hold."""
    return (row.shape[0] - GRIPPERS_WIDTH) // 3


@compiled
def n_points(row: Any) -> int:
    """Count the points of a band, without repetitions of the last one."""
    n = room_for_points(row)
    while n > 2:
        last, before = offset_of_point(n - 1), offset_of_point(n - 2)
        same = row[last] == row[before] and row[last + 1] == row[before + 1]
        if not (same and row[last + 2] == row[before + 2]):
            break
        n -= 1
    return n


@compiled
def read_points(row: Any, points: Any) -> int:
    """Copy the points of a band to an array's first columns; return how many there are."""
    n = n_points(row)
    for i in range(n):
        for axis in range(3):
            points[i, axis] = row[offset_of_point(i) + axis]
    return n


@compiled
def write_band(points: Any, n: int, row: Any) -> None:
    """Write n points, in an array's first columns, as a band."""
    for axis in range(3):
        row[axis], row[3 + axis] = points[0, axis], points[n - 1, axis]
    for i in range(room_for_points(row)):
        for axis in range(3):
            row[offset_of_point(i) + axis] = points[min(i, n - 1), axis]


@compiled(inline="always")
def segment_length(row: Any, i: int, flat: bool) -> float:
    """Length of the segment from the i-th point on, or of its projection onto the floor."""
    k = offset_of_point(i)
    x, y = row[k + 3] - row[k], row[k + 4] - row[k + 1]
    z = 0.0 if flat else row[k + 5] - row[k + 2]
    return np.sqrt(x * x + y * y + z * z)


@compiled
def length_of_band(row: Any, flat: bool) -> float:
    """Length of the band, or of its projection onto the floor."""
    total = 0.0
    for i in range(n_points(row) - 1):
        total += segment_length(row, i, flat)
    return total


@compiled
def fill_points_along(row: Any, offset: float, spacing: float, flat: bool, points: Any) -> None:
    """Write points of the band at the arc lengths (j + offset) * spacing, for j = 0, 1, ...

    With ``flat``, arc lengths are those of the band's projection onto the floor.
    """
    n, m = n_points(row), points.shape[0]
    i, start, length = 0, 0.0, segment_length(row, 0, flat)
    for j in range(m):
        arc = (j + offset) * spacing
        while i < n - 2 and arc > start + length:
            start += length
            i += 1
            length = segment_length(row, i, flat)
        # Along a segment without length, for instance a vertical one seen from above, the points
        # are spread in the order of their numbers.
        ratio = (arc - start) / length if length > _LEAST_SEGMENT else (j + offset) / m
        ratio, k = min(1.0, ratio), offset_of_point(i)
        for axis in range(3):
            points[j, axis] = row[k + axis] + ratio * (row[k + 3 + axis] - row[k + axis])


@compiled
def fill_lengths(rows: Any, lengths: Any) -> None:
    """Write the length of each row's band."""
    for i in range(rows.shape[0]):
        lengths[i] = length_of_band(rows[i], False)


@compiled
def resample_row(row: Any, points: Any) -> None:
    """Write points that are evenly spaced along the band, ends included."""
    spacing = length_of_band(row, False) / (points.shape[0] - 1)
    fill_points_along(row, 0.0, spacing, False, points)
