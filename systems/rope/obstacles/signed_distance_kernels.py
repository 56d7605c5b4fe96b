"""Compiled signed distances from points to packed obstacles, and their gradients.

A signed distance is positive outside an obstacle and negative inside. Obstacles are rows of the
table that :func:`systems.rope.obstacles.shapes.pack_obstacles` writes; lengths are metres.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.obstacles.shapes import (
    AXIS,
    BOX,
    CORE_X,
    CORE_Y,
    CORE_Z,
    CYLINDER,
    HALF_LENGTH,
    HALF_X,
    HALF_Y,
    HALF_Z,
    KIND,
    RADIUS,
    X,
    Y,
    Z,
)

EMPTY = 1e9  # the distance, in metres, where there are no obstacles


@compiled(inline="always")
def cylinder_distance(x: float, y: float, z: float, row: Any, bound: float) -> float:
    """Signed distance to a cylinder along a world axis, or ``bound`` if that is smaller."""
    u, v, w = x - row[X], y - row[Y], z - row[Z]
    if row[AXIS] == 0.0:
        u, v, w = v, w, u
    elif row[AXIS] == 1.0:
        u, v, w = u, w, v
    axial, reach, square = abs(w) - row[HALF_LENGTH], bound + row[RADIUS], u * u + v * v
    # Most cylinders are too far away to matter: return before taking a square root.
    if axial >= bound or (reach > 0.0 and square >= reach * reach):
        return bound
    radial = np.sqrt(square) - row[RADIUS]
    if radial <= 0.0 or axial <= 0.0:
        return max(radial, axial)
    return np.sqrt(radial * radial + axial * axial)


@compiled(inline="always")
def capsule_distance(x: float, y: float, z: float, row: Any, bound: float) -> float:
    """Signed distance to a capsule, or ``bound`` if that is smaller."""
    u, v, w = x - row[X], y - row[Y], z - row[Z]
    along = u * row[CORE_X] + v * row[CORE_Y] + w * row[CORE_Z]
    along /= row[CORE_X] * row[CORE_X] + row[CORE_Y] * row[CORE_Y] + row[CORE_Z] * row[CORE_Z]
    along = min(1.0, max(0.0, along))
    u, v, w = u - along * row[CORE_X], v - along * row[CORE_Y], w - along * row[CORE_Z]
    square, reach = u * u + v * v + w * w, bound + row[RADIUS]
    if reach > 0.0 and square >= reach * reach:
        return bound
    return np.sqrt(square) - row[RADIUS]


@compiled
def nearest_obstacle(x: float, y: float, z: float, packed: Any) -> tuple[float, int]:
    """Return the signed distance to the nearest obstacle and its row; -1 if there is none."""
    n = packed.shape[0]
    n_boxes, best, depth, index = n, EMPTY * EMPTY, 0.0, -1
    # Boxes come first in the table. Their squared distances are compared, so that a single square
    # root serves them all. This is the hottest loop of the rope, so it avoids `max`, which also
    # checks for NaN.
    for i in range(n):
        if packed[i, KIND] != BOX:
            n_boxes = i
            break
        u = abs(x - packed[i, X]) - packed[i, HALF_X]
        v = abs(y - packed[i, Y]) - packed[i, HALF_Y]
        w = abs(z - packed[i, Z]) - packed[i, HALF_Z]
        a = u if u > 0.0 else 0.0
        b = v if v > 0.0 else 0.0
        c = w if w > 0.0 else 0.0
        square = a * a + b * b + c * c
        if square < best:
            best, index = square, i
        if square == 0.0 and max(u, v, w) < depth:
            depth, index = max(u, v, w), i
    distance = np.sqrt(best) + depth
    for i in range(n_boxes, n):
        row = packed[i]
        if row[KIND] == CYLINDER:
            other = cylinder_distance(x, y, z, row, distance)
        else:
            other = capsule_distance(x, y, z, row, distance)
        if other < distance:
            distance, index = other, i
    return distance, index


@compiled
def distance(x: float, y: float, z: float, packed: Any) -> float:
    """Signed distance to the nearest obstacle."""
    return nearest_obstacle(x, y, z, packed)[0]


@compiled
def box_gradient(x: float, y: float, z: float, row: Any) -> tuple[float, float, float]:
    """Gradient of the signed distance to a box."""
    u, v, w = x - row[X], y - row[Y], z - row[Z]
    a, b, c = abs(u) - row[HALF_X], abs(v) - row[HALF_Y], abs(w) - row[HALF_Z]
    su, sv, sw = (1.0 if u >= 0.0 else -1.0), (1.0 if v >= 0.0 else -1.0), (1.0 if w >= 0 else -1.0)
    if a <= 0.0 and b <= 0.0 and c <= 0.0:
        if a >= b and a >= c:
            return su, 0.0, 0.0
        return (0.0, sv, 0.0) if b >= c else (0.0, 0.0, sw)
    a, b, c = max(a, 0.0), max(b, 0.0), max(c, 0.0)
    norm = np.sqrt(a * a + b * b + c * c)
    return su * a / norm, sv * b / norm, sw * c / norm


@compiled
def cylinder_gradient(x: float, y: float, z: float, row: Any) -> tuple[float, float, float]:
    """Gradient of the signed distance to a cylinder along a world axis."""
    u, v, w = x - row[X], y - row[Y], z - row[Z]
    if row[AXIS] == 0.0:
        u, v, w = v, w, u
    elif row[AXIS] == 1.0:
        u, v, w = u, w, v
    rho = np.sqrt(u * u + v * v)
    # On the axis all radial directions are equally near the surface; take the first.
    e0, e1 = (u / rho, v / rho) if rho > 0.0 else (1.0, 0.0)
    e2 = 1.0 if w >= 0.0 else -1.0
    radial, axial = rho - row[RADIUS], abs(w) - row[HALF_LENGTH]
    if radial <= 0.0 and axial <= 0.0:
        radial, axial = (1.0, 0.0) if radial >= axial else (0.0, 1.0)
    radial, axial = max(radial, 0.0), max(axial, 0.0)
    norm = np.sqrt(radial * radial + axial * axial)
    e0, e1, e2 = e0 * radial / norm, e1 * radial / norm, e2 * axial / norm
    if row[AXIS] == 0.0:
        return e2, e0, e1
    return (e0, e2, e1) if row[AXIS] == 1.0 else (e0, e1, e2)


@compiled
def capsule_gradient(x: float, y: float, z: float, row: Any) -> tuple[float, float, float]:
    """Gradient of the signed distance to a capsule."""
    u, v, w = x - row[X], y - row[Y], z - row[Z]
    square = row[CORE_X] * row[CORE_X] + row[CORE_Y] * row[CORE_Y] + row[CORE_Z] * row[CORE_Z]
    along = min(1.0, max(0.0, (u * row[CORE_X] + v * row[CORE_Y] + w * row[CORE_Z]) / square))
    u, v, w = u - along * row[CORE_X], v - along * row[CORE_Y], w - along * row[CORE_Z]
    norm = np.sqrt(u * u + v * v + w * w)
    if norm > 0.0:
        return u / norm, v / norm, w / norm
    # On the core segment all directions across it are equally near the surface; take one.
    if row[CORE_X] * row[CORE_X] < 0.5 * square:
        norm = np.sqrt(row[CORE_Y] * row[CORE_Y] + row[CORE_Z] * row[CORE_Z])
        return 0.0, -row[CORE_Z] / norm, row[CORE_Y] / norm
    norm = np.sqrt(row[CORE_X] * row[CORE_X] + row[CORE_Y] * row[CORE_Y])
    return -row[CORE_Y] / norm, row[CORE_X] / norm, 0.0


@compiled
def gradient(x: float, y: float, z: float, row: Any) -> tuple[float, float, float]:
    """Gradient of the signed distance to one obstacle."""
    if row[KIND] == BOX:
        return box_gradient(x, y, z, row)
    if row[KIND] == CYLINDER:
        return cylinder_gradient(x, y, z, row)
    return capsule_gradient(x, y, z, row)


@compiled
def distance_and_gradient(
    x: float, y: float, z: float, packed: Any
) -> tuple[float, float, float, float]:
    """Signed distance to the nearest obstacle, then the three entries of its gradient."""
    d, index = nearest_obstacle(x, y, z, packed)
    if index < 0:
        return d, 0.0, 0.0, 0.0
    gx, gy, gz = gradient(x, y, z, packed[index])
    return d, gx, gy, gz


@compiled
def fill_distances(points: Any, packed: Any, distances: Any) -> None:
    """Write the signed distance of each point."""
    for i in range(points.shape[0]):
        distances[i] = distance(points[i, 0], points[i, 1], points[i, 2], packed)
