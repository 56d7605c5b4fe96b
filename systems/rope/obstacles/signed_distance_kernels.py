"""Compiled signed distances from points to packed obstacles, and their gradients.

A signed distance is positive outside an obstacle and negative inside. Obstacles are rows of the
table that :func:`systems.rope.obstacles.packing.pack_obstacles` writes; lengths are metres.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.obstacles.box_kernels import (
    box_gradient,
    rotated_box_distance,
    rotated_box_gradient,
)
from systems.rope.obstacles.packing import (
    BOX,
    CAPSULE,
    CYLINDER,
    HALF_X,
    HALF_Y,
    HALF_Z,
    KIND,
    N_FACES,
    POLYHEDRON,
    RADIUS,
    ROTATED_BOX,
    ROWS_OF_FACE,
    ROWS_OF_ROTATED_BOX,
    SLANTED_CYLINDER,
    SPHERE,
    X,
    Y,
    Z,
)
from systems.rope.obstacles.polyhedron_kernels import polyhedron_distance, polyhedron_gradient
from systems.rope.obstacles.round_kernels import (
    capsule_distance,
    capsule_gradient,
    cylinder_distance,
    cylinder_gradient,
    slanted_cylinder_distance,
    slanted_cylinder_gradient,
    sphere_distance,
    sphere_gradient,
)

EMPTY = 1e9  # the distance, in metres, where there are no obstacles


@compiled(inline="always")
def row_after(packed: Any, index: int) -> int:
    """Return the first row after an obstacle's."""
    if packed[index, KIND] == ROTATED_BOX:
        return index + ROWS_OF_ROTATED_BOX
    if packed[index, KIND] == POLYHEDRON:
        return index + 1 + ROWS_OF_FACE * int(packed[index, N_FACES])
    return index + 1


@compiled
def radius_around(row: Any) -> float:
    """Return the radius of a ball, around its centre, that an obstacle that few scenes have is in.

    ``row`` is its first.
    """
    if row[KIND] == SPHERE or row[KIND] == POLYHEDRON:
        return row[RADIUS]
    # Half of a box's sides, or half of a cylinder's axis.
    square = row[HALF_X] ** 2 + row[HALF_Y] ** 2 + row[HALF_Z] ** 2
    return np.sqrt(square + row[RADIUS] ** 2)


@compiled
def seldom_distance(x: float, y: float, z: float, packed: Any, index: int, bound: float) -> float:
    """Signed distance to an obstacle of a kind that few scenes have, or ``bound`` if smaller."""
    row = packed[index]
    if row[KIND] == SLANTED_CYLINDER:
        return slanted_cylinder_distance(x, y, z, row, bound)
    if row[KIND] == SPHERE:
        return sphere_distance(x, y, z, row, bound)
    if row[KIND] == ROTATED_BOX:
        return rotated_box_distance(x, y, z, packed, index, bound)
    return polyhedron_distance(x, y, z, packed, index, bound)


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
    i = n_boxes
    while i < n:
        row = packed[i]
        if row[KIND] == CYLINDER:
            other = cylinder_distance(x, y, z, row, distance)
        elif row[KIND] == CAPSULE:
            other = capsule_distance(x, y, z, row, distance)
        else:
            other = seldom_distance(x, y, z, packed, i, distance)
        if other < distance:
            distance, index = other, i
        i = row_after(packed, i)
    return distance, index


@compiled
def distance(x: float, y: float, z: float, packed: Any) -> float:
    """Signed distance to the nearest obstacle."""
    return nearest_obstacle(x, y, z, packed)[0]


@compiled
def gradient(x: float, y: float, z: float, packed: Any, index: int) -> tuple[float, float, float]:
    """Gradient of the signed distance to the obstacle that begins at a row."""
    row = packed[index]
    if row[KIND] == BOX:
        return box_gradient(x - row[X], y - row[Y], z - row[Z], row)
    if row[KIND] == CYLINDER:
        return cylinder_gradient(x, y, z, row)
    if row[KIND] == CAPSULE:
        return capsule_gradient(x, y, z, row)
    if row[KIND] == SLANTED_CYLINDER:
        return slanted_cylinder_gradient(x, y, z, row)
    if row[KIND] == SPHERE:
        return sphere_gradient(x, y, z, row)
    if row[KIND] == ROTATED_BOX:
        return rotated_box_gradient(x, y, z, packed, index)
    return polyhedron_gradient(x, y, z, packed, index)


@compiled
def distance_and_gradient(
    x: float, y: float, z: float, packed: Any
) -> tuple[float, float, float, float]:
    """Signed distance to the nearest obstacle, then the three entries of its gradient."""
    d, index = nearest_obstacle(x, y, z, packed)
    if index < 0:
        return d, 0.0, 0.0, 0.0
    gx, gy, gz = gradient(x, y, z, packed, index)
    return d, gx, gy, gz


@compiled
def fill_distances(points: Any, packed: Any, distances: Any) -> None:
    """Write the signed distance of each point."""
    for i in range(points.shape[0]):
        distances[i] = distance(points[i, 0], points[i, 1], points[i, 2], packed)
