"""Compiled signed distances of points from planes, spheres, capsules, cylinders and boxes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from systems.compilation import compiled

# MuJoCo's numbers of these kinds of geom (mjtGeom).
PLANE, SPHERE, CAPSULE, CYLINDER, BOX = 0, 2, 3, 5, 6
PRIMITIVES = (PLANE, SPHERE, CAPSULE, CYLINDER, BOX)


@compiled
def nearest_primitive(points: Any, kinds: Any, centres: Any, axes: Any, sizes: Any) -> Any:
    """Return the signed distance of each point from the nearest of some primitives, shape (n,).

    Parameters
    ----------
    points : ndarray of shape (n, 3)
        Metres, world frame.
    kinds : ndarray of int of shape (m,)
        Of ``PRIMITIVES``.
    centres : ndarray of shape (m, 3)
    axes : ndarray of shape (m, 3, 3)
        Columns are the primitives' own axes in the world frame.
    sizes : ndarray of shape (m, 3)
        As MuJoCo's ``geom_size``: radius, half length or half lengths, metres.

    Returns
    -------
    distances : ndarray of shape (n,)
        Negative inside; infinite if there are no primitives.
    """
    distances = np.full(points.shape[0], np.inf)
    for i in range(points.shape[0]):
        for j in range(kinds.shape[0]):
            x, y, z = _in_own_frame(points[i], centres[j], axes[j])
            found = _distance(kinds[j], x, y, z, sizes[j])
            distances[i] = min(distances[i], found)
    return distances


@compiled(inline="always")
def _in_own_frame(point: Any, centre: Any, axes: Any) -> Any:
    x = y = z = 0.0
    for k in range(3):
        way = point[k] - centre[k]
        x += way * axes[k, 0]
        y += way * axes[k, 1]
        z += way * axes[k, 2]
    return x, y, z


@compiled(inline="always")
def _distance(kind: int, x: float, y: float, z: float, size: Any) -> float:
    if kind == PLANE:
        return z
    if kind == SPHERE:
        return math.sqrt(x * x + y * y + z * z) - size[0]
    if kind == CAPSULE:
        beyond = max(abs(z) - size[1], 0.0)
        return math.sqrt(x * x + y * y + beyond * beyond) - size[0]
    if kind == CYLINDER:
        return _beyond(math.sqrt(x * x + y * y) - size[0], abs(z) - size[1], -np.inf)
    return _beyond(abs(x) - size[0], abs(y) - size[1], abs(z) - size[2])


@compiled(inline="always")
def _beyond(a: float, b: float, c: float) -> float:
    """Return how far a point is from where it is within limits, which a, b and c exceed."""
    outside = math.sqrt(max(a, 0.0) ** 2 + max(b, 0.0) ** 2 + max(c, 0.0) ** 2)
    return outside + min(max(a, b, c), 0.0)
