"""Compiled signed distances from points to boxes, and their gradients."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.obstacles.packing import HALF_X, HALF_Y, HALF_Z, X, Y, Z


@compiled
def rotated_box_distance(
    x: float, y: float, z: float, packed: Any, index: int, bound: float
) -> float:
    """Signed distance to the box that begins at a row, or ``bound`` if that is smaller."""
    u, v, w = along_sides(x, y, z, packed, index)
    row = packed[index]
    u, v, w = abs(u) - row[HALF_X], abs(v) - row[HALF_Y], abs(w) - row[HALF_Z]
    depth = max(u, v, w)
    if depth >= bound:
        return bound
    if depth <= 0.0:
        return depth
    a, b, c = max(u, 0.0), max(v, 0.0), max(w, 0.0)
    return np.sqrt(a * a + b * b + c * c)


@compiled
def rotated_box_gradient(
    x: float, y: float, z: float, packed: Any, index: int
) -> tuple[float, float, float]:
    """Gradient of the signed distance to the box that begins at a row."""
    u, v, w = along_sides(x, y, z, packed, index)
    a, b, c = box_gradient(u, v, w, packed[index])
    first, second, third = packed[index + 1], packed[index + 2], packed[index + 3]
    return (
        a * first[X] + b * second[X] + c * third[X],
        a * first[Y] + b * second[Y] + c * third[Y],
        a * first[Z] + b * second[Z] + c * third[Z],
    )


@compiled
def along_sides(
    x: float, y: float, z: float, packed: Any, index: int
) -> tuple[float, float, float]:
    """Return where a point is as seen from a rotated box: from its centre, along its sides."""
    u, v, w = x - packed[index, X], y - packed[index, Y], z - packed[index, Z]
    first, second, third = packed[index + 1], packed[index + 2], packed[index + 3]
    return (
        u * first[X] + v * first[Y] + w * first[Z],
        u * second[X] + v * second[Y] + w * second[Z],
        u * third[X] + v * third[Y] + w * third[Z],
    )


@compiled
def box_gradient(u: float, v: float, w: float, row: Any) -> tuple[float, float, float]:
    """Gradient of the signed distance to a box, where a point is from its centre, along its sides.

    The gradient is along the box's sides, too.
    """
    a, b, c = abs(u) - row[HALF_X], abs(v) - row[HALF_Y], abs(w) - row[HALF_Z]
    su, sv, sw = (1.0 if u >= 0.0 else -1.0), (1.0 if v >= 0.0 else -1.0), (1.0 if w >= 0 else -1.0)
    if a <= 0.0 and b <= 0.0 and c <= 0.0:
        if a >= b and a >= c:
            return su, 0.0, 0.0
        return (0.0, sv, 0.0) if b >= c else (0.0, 0.0, sw)
    a, b, c = max(a, 0.0), max(b, 0.0), max(c, 0.0)
    norm = np.sqrt(a * a + b * b + c * c)
    return su * a / norm, sv * b / norm, sw * c / norm
