"""Compiled signed distances from points to convex polyhedra, and their gradients.

Inside, the nearest place of the surface is on the face whose plane is nearest. Outside, it is on
one of the faces that can be seen from the point, those whose planes the point is beyond.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.obstacles.packing import (
    N_FACES,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    OTHER_EDGE_X,
    OTHER_EDGE_Y,
    OTHER_EDGE_Z,
    RADIUS,
    ROWS_OF_FACE,
    X,
    Y,
    Z,
)

# Metres: so near to the surface, the way to its nearest place is mostly rounding.
_ON_SURFACE = 1e-9


@compiled
def polyhedron_distance(
    x: float, y: float, z: float, packed: Any, index: int, bound: float
) -> float:
    """Signed distance to the polyhedron that begins at a row, or ``bound`` if that is smaller."""
    u, v, w = x - packed[index, X], y - packed[index, Y], z - packed[index, Z]
    reach = bound + packed[index, RADIUS]
    if reach > 0.0 and u * u + v * v + w * w >= reach * reach:
        return bound
    height, _ = above_faces(x, y, z, packed, index)
    if height <= 0.0 or height >= bound:
        return min(height, bound)
    u, v, w = way_from_surface(x, y, z, packed, index)
    return min(bound, np.sqrt(u * u + v * v + w * w))


@compiled
def polyhedron_gradient(
    x: float, y: float, z: float, packed: Any, index: int
) -> tuple[float, float, float]:
    """Gradient of the signed distance to the polyhedron that begins at a row."""
    height, face = above_faces(x, y, z, packed, index)
    if height > 0.0:
        u, v, w = way_from_surface(x, y, z, packed, index)
        norm = np.sqrt(u * u + v * v + w * w)
        if norm > _ON_SURFACE:
            return u / norm, v / norm, w / norm
    return packed[face, NORMAL_X], packed[face, NORMAL_Y], packed[face, NORMAL_Z]


@compiled
def above_faces(x: float, y: float, z: float, packed: Any, index: int) -> tuple[float, int]:
    """Return how high a point is above the face that it is highest above, and the face's row."""
    highest, highest_face = -np.inf, -1
    first = index + 1
    for face in range(first, first + ROWS_OF_FACE * int(packed[index, N_FACES]), ROWS_OF_FACE):
        height = above_face(x, y, z, packed[face])
        if height > highest:
            highest, highest_face = height, face
    return highest, highest_face


@compiled
def above_face(x: float, y: float, z: float, row: Any) -> float:
    """Return how high a point is above the plane of a face."""
    u, v, w = x - row[X], y - row[Y], z - row[Z]
    return u * row[NORMAL_X] + v * row[NORMAL_Y] + w * row[NORMAL_Z]


@compiled
def way_from_surface(
    x: float, y: float, z: float, packed: Any, index: int
) -> tuple[float, float, float]:
    """Return the way from the nearest place of the surface to a point outside."""
    nearest, best_u, best_v, best_w = np.inf, 0.0, 0.0, 0.0
    first = index + 1
    for face in range(first, first + ROWS_OF_FACE * int(packed[index, N_FACES]), ROWS_OF_FACE):
        if above_face(x, y, z, packed[face]) > 0.0:
            u, v, w = way_from_triangle(x, y, z, packed[face], packed[face + 1])
            square = u * u + v * v + w * w
            if square < nearest:
                nearest, best_u, best_v, best_w = square, u, v, w
    return best_u, best_v, best_w


@compiled
def way_from_triangle(
    x: float, y: float, z: float, face: Any, edges: Any
) -> tuple[float, float, float]:
    """Return the way from the nearest place of a triangle to a point."""
    u, v, w = x - face[X], y - face[Y], z - face[Z]
    a, b, c = edges[X], edges[Y], edges[Z]
    d, e, f = edges[OTHER_EDGE_X], edges[OTHER_EDGE_Y], edges[OTHER_EDGE_Z]
    # The foot of the point on the plane is s times the one edge and t times the other.
    aa, dd, ad = a * a + b * b + c * c, d * d + e * e + f * f, a * d + b * e + c * f
    on_a, on_d = u * a + v * b + w * c, u * d + v * e + w * f
    area = aa * dd - ad * ad
    s, t = dd * on_a - ad * on_d, aa * on_d - ad * on_a
    if area > 0.0 and s >= 0.0 and t >= 0.0 and s + t <= area:
        s, t = s / area, t / area
        return u - s * a - t * d, v - s * b - t * e, w - s * c - t * f
    one = way_from_segment(u, v, w, a, b, c)
    other = way_from_segment(u, v, w, d, e, f)
    third = way_from_segment(u - a, v - b, w - c, d - a, e - b, f - c)
    return shortest(one, shortest(other, third))


@compiled
def way_from_segment(
    u: float, v: float, w: float, a: float, b: float, c: float
) -> tuple[float, float, float]:
    """Return the way to (u, v, w) from the nearest place of the segment from 0 to (a, b, c)."""
    along = min(1.0, max(0.0, (u * a + v * b + w * c) / (a * a + b * b + c * c)))
    return u - along * a, v - along * b, w - along * c


@compiled
def shortest(one: Any, other: Any) -> Any:
    """Return the shorter one of two vectors."""
    length = one[0] * one[0] + one[1] * one[1] + one[2] * one[2]
    if other[0] * other[0] + other[1] * other[1] + other[2] * other[2] < length:
        return other
    return one
