"""Compiled signed distances from points to cylinders, capsules and spheres, and their gradients.

Distances are computed only as far as a ``bound``, the distance to the nearest obstacle so far.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.obstacles.packing import (
    AXIS,
    CORE_X,
    CORE_Y,
    CORE_Z,
    HALF_LENGTH,
    RADIUS,
    X,
    Y,
    Z,
)

# Metres; what is left of a distance to a core segment below this is rounding, whatever its way.
_ON_CORE = 1e-12


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


@compiled
def slanted_cylinder_distance(x: float, y: float, z: float, row: Any, bound: float) -> float:
    """Signed distance to a cylinder along any direction, or ``bound`` if that is smaller."""
    u, v, w = x - row[X], y - row[Y], z - row[Z]
    reach = bound + row[RADIUS]
    square = row[CORE_X] * row[CORE_X] + row[CORE_Y] * row[CORE_Y] + row[CORE_Z] * row[CORE_Z]
    along = (u * row[CORE_X] + v * row[CORE_Y] + w * row[CORE_Z]) / square
    axial = (abs(along) - 1.0) * np.sqrt(square)
    u, v, w = u - along * row[CORE_X], v - along * row[CORE_Y], w - along * row[CORE_Z]
    square = u * u + v * v + w * w
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
def sphere_distance(x: float, y: float, z: float, row: Any, bound: float) -> float:
    """Signed distance to a sphere, or ``bound`` if that is smaller."""
    u, v, w = x - row[X], y - row[Y], z - row[Z]
    square, reach = u * u + v * v + w * w, bound + row[RADIUS]
    if reach <= 0.0 or square >= reach * reach:
        return bound
    return np.sqrt(square) - row[RADIUS]


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
    radial, axial, norm = radial_and_axial(rho - row[RADIUS], abs(w) - row[HALF_LENGTH])
    e0, e1, e2 = e0 * radial / norm, e1 * radial / norm, e2 * axial / norm
    if row[AXIS] == 0.0:
        return e2, e0, e1
    return (e0, e2, e1) if row[AXIS] == 1.0 else (e0, e1, e2)


@compiled
def slanted_cylinder_gradient(x: float, y: float, z: float, row: Any) -> tuple[float, float, float]:
    """Gradient of the signed distance to a cylinder along any direction."""
    u, v, w = x - row[X], y - row[Y], z - row[Z]
    half = np.sqrt(row[CORE_X] ** 2 + row[CORE_Y] ** 2 + row[CORE_Z] ** 2)
    a, b, c = row[CORE_X] / half, row[CORE_Y] / half, row[CORE_Z] / half
    height = u * a + v * b + w * c
    u, v, w = u - height * a, v - height * b, w - height * c
    rho = np.sqrt(u * u + v * v + w * w)
    e0, e1, e2 = (u / rho, v / rho, w / rho) if rho > 0.0 else across(a, b, c)
    radial, axial, norm = radial_and_axial(rho - row[RADIUS], abs(height) - half)
    radial, axial = radial / norm, (axial if height >= 0.0 else -axial) / norm
    return radial * e0 + axial * a, radial * e1 + axial * b, radial * e2 + axial * c


@compiled
def radial_and_axial(radial: float, axial: float) -> tuple[float, float, float]:
    """Return a vector along a cylinder's gradient, away from its axis and along it; its length.

    ``radial`` and ``axial`` are how far a point is beyond the cylinder's radius and length.
    """
    if radial <= 0.0 and axial <= 0.0:
        radial, axial = (1.0, 0.0) if radial >= axial else (0.0, 1.0)
    radial, axial = max(radial, 0.0), max(axial, 0.0)
    return radial, axial, np.sqrt(radial * radial + axial * axial)


@compiled
def capsule_gradient(x: float, y: float, z: float, row: Any) -> tuple[float, float, float]:
    """Gradient of the signed distance to a capsule."""
    u, v, w = x - row[X], y - row[Y], z - row[Z]
    square = row[CORE_X] * row[CORE_X] + row[CORE_Y] * row[CORE_Y] + row[CORE_Z] * row[CORE_Z]
    along = min(1.0, max(0.0, (u * row[CORE_X] + v * row[CORE_Y] + w * row[CORE_Z]) / square))
    u, v, w = u - along * row[CORE_X], v - along * row[CORE_Y], w - along * row[CORE_Z]
    norm = np.sqrt(u * u + v * v + w * w)
    if norm > _ON_CORE:
        return u / norm, v / norm, w / norm
    # On the core segment all directions across it are equally near the surface.
    return across(row[CORE_X], row[CORE_Y], row[CORE_Z])


@compiled
def sphere_gradient(x: float, y: float, z: float, row: Any) -> tuple[float, float, float]:
    """Gradient of the signed distance to a sphere."""
    u, v, w = x - row[X], y - row[Y], z - row[Z]
    norm = np.sqrt(u * u + v * v + w * w)
    # In the centre all directions are equally near the surface; take the last.
    return (u / norm, v / norm, w / norm) if norm > 0.0 else (0.0, 0.0, 1.0)


@compiled
def across(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a direction, of length 1, across a vector."""
    if x * x < 0.5 * (x * x + y * y + z * z):
        norm = np.sqrt(y * y + z * z)
        return 0.0, -z / norm, y / norm
    norm = np.sqrt(x * x + y * y)
    return -y / norm, x / norm, 0.0
