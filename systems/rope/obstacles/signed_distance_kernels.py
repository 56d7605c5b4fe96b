"""Compiled signed distances from points to packed obstacles (see systems.rope.obstacles.shapes)."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled

EMPTY = 1e9  # distance to an environment without obstacles


@compiled(inline="always")
def cylinder_distance(x: float, y: float, z: float, row: Any, bound: float) -> float:
    """Signed distance to a cylinder along an axis, or ``bound`` where it is no smaller."""
    u, v, w = x - row[1], y - row[2], z - row[3]
    if row[4] == 0.0:
        u, v, w = v, w, u
    elif row[4] == 1.0:
        u, v, w = u, w, v
    axial, reach, square = abs(w) - row[5], bound + row[7], u * u + v * v
    # Most cylinders are too far away to matter, which is seen before any root is taken.
    if axial >= bound or (reach > 0.0 and square >= reach * reach):
        return bound
    radial = np.sqrt(square) - row[7]
    if radial <= 0.0 or axial <= 0.0:
        return max(radial, axial)
    return np.sqrt(radial * radial + axial * axial)


@compiled(inline="always")
def capsule_distance(x: float, y: float, z: float, row: Any, bound: float) -> float:
    """Signed distance to a capsule, or ``bound`` where it is no smaller."""
    u, v, w = x - row[1], y - row[2], z - row[3]
    along = u * row[4] + v * row[5] + w * row[6]
    along /= row[4] * row[4] + row[5] * row[5] + row[6] * row[6]
    along = min(1.0, max(0.0, along))
    u, v, w = u - along * row[4], v - along * row[5], w - along * row[6]
    square, reach = u * u + v * v + w * w, bound + row[7]
    if reach > 0.0 and square >= reach * reach:
        return bound
    return np.sqrt(square) - row[7]


@compiled
def nearest_obstacle(x: float, y: float, z: float, packed: Any) -> tuple[float, int]:
    """Return the signed distance to the nearest obstacle and its row, or -1 without any."""
    n = packed.shape[0]
    n_boxes, best, depth, index = n, EMPTY * EMPTY, 0.0, -1
    # Boxes come first; squares are compared, so that one root serves them all. This is the
    # hottest loop of the rope: `max` would look for NaN.
    for i in range(n):
        if packed[i, 0] != 0.0:
            n_boxes = i
            break
        u = abs(x - packed[i, 1]) - packed[i, 4]
        v = abs(y - packed[i, 2]) - packed[i, 5]
        w = abs(z - packed[i, 3]) - packed[i, 6]
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
        if row[0] == 1.0:
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
    u, v, w = x - row[1], y - row[2], z - row[3]
    a, b, c = abs(u) - row[4], abs(v) - row[5], abs(w) - row[6]
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
    """Gradient of the signed distance to a cylinder along an axis."""
    u, v, w = x - row[1], y - row[2], z - row[3]
    if row[4] == 0.0:
        u, v, w = v, w, u
    elif row[4] == 1.0:
        u, v, w = u, w, v
    rho = np.sqrt(u * u + v * v)
    # On the axis every radial direction is as good as any other.
    e0, e1 = (u / rho, v / rho) if rho > 0.0 else (1.0, 0.0)
    e2 = 1.0 if w >= 0.0 else -1.0
    radial, axial = rho - row[7], abs(w) - row[5]
    if radial <= 0.0 and axial <= 0.0:
        radial, axial = (1.0, 0.0) if radial >= axial else (0.0, 1.0)
    radial, axial = max(radial, 0.0), max(axial, 0.0)
    norm = np.sqrt(radial * radial + axial * axial)
    e0, e1, e2 = e0 * radial / norm, e1 * radial / norm, e2 * axial / norm
    if row[4] == 0.0:
        return e2, e0, e1
    return (e0, e2, e1) if row[4] == 1.0 else (e0, e1, e2)


@compiled
def capsule_gradient(x: float, y: float, z: float, row: Any) -> tuple[float, float, float]:
    """Gradient of the signed distance to a capsule."""
    u, v, w = x - row[1], y - row[2], z - row[3]
    square = row[4] * row[4] + row[5] * row[5] + row[6] * row[6]
    along = min(1.0, max(0.0, (u * row[4] + v * row[5] + w * row[6]) / square))
    u, v, w = u - along * row[4], v - along * row[5], w - along * row[6]
    norm = np.sqrt(u * u + v * v + w * w)
    if norm > 0.0:
        return u / norm, v / norm, w / norm
    # On the core segment every direction across it is as good as any other.
    if row[4] * row[4] < 0.5 * square:
        norm = np.sqrt(row[5] * row[5] + row[6] * row[6])
        return 0.0, -row[6] / norm, row[5] / norm
    norm = np.sqrt(row[4] * row[4] + row[5] * row[5])
    return -row[5] / norm, row[4] / norm, 0.0


@compiled
def gradient(x: float, y: float, z: float, row: Any) -> tuple[float, float, float]:
    """Gradient of the signed distance to one obstacle."""
    if row[0] == 0.0:
        return box_gradient(x, y, z, row)
    if row[0] == 1.0:
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


@compiled
def fill_distances_and_gradients(points: Any, packed: Any, distances: Any, gradients: Any) -> None:
    """Write the signed distance of each point and its gradient."""
    for i in range(points.shape[0]):
        d, gx, gy, gz = distance_and_gradient(points[i, 0], points[i, 1], points[i, 2], packed)
        distances[i] = d
        gradients[i, 0], gradients[i, 1], gradients[i, 2] = gx, gy, gz
