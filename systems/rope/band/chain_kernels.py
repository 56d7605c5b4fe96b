r"""Compiled chains: what an elastic band is while it is worked on.

A chain is an array with a row for each point of the band: x, y, z, the signed distance to the
nearest obstacle there, and whether the point changed in its last turn. The distance says how far
the point's surroundings are free: the ball of that radius around it, its *bubble*, holds no
obstacle. A segment is free of obstacles if bubbles cover it from one end to the other::

           ______   ____   ________
          /      \ /    \ /        \
      ---(---p----X--o---X----q-----)---
          \______/ \____/ \________/

If the segment's ends moved, the bubbles can cover the area that it swept on its way, too. So a
band that is only ever changed within bubbles can't jump over an obstacle.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from systems.compilation import compiled
from systems.rope.obstacles.signed_distance_kernels import distance, gradient, nearest_obstacle

# The columns of a chain after x, y, z.
DISTANCE, CHANGED, CHAIN_WIDTH = 3, 4, 5

# The points of a band keep the rope's radius away from obstacles, as the rope's centre line must;
# segments may pass more closely, down to the floor, so that a corner needs few points. Metres.
CLEARANCE = 0.01
FLOOR = 0.006
# Bubbles that are smaller do not cover anything; more of them are not tried.
MIN_BUBBLE = 1e-3
_MAX_BUBBLES = 2000

# A point is pushed out of obstacles in so many steps, a little farther than is asked.
_MAX_PUSHES = 8
_MARGIN = 1e-7


class Vector(NamedTuple):
    """A position or a displacement, metres in the world frame."""

    x: float
    y: float
    z: float


class Point(NamedTuple):
    """A position, and its signed distance to the nearest obstacle."""

    x: float
    y: float
    z: float
    distance: float


NO_MOTION = Vector(0.0, 0.0, 0.0)


@compiled(inline="always")
def point_at(chain: Any, i: int) -> Point:
    """Read a point of a chain."""
    return Point(chain[i, 0], chain[i, 1], chain[i, 2], chain[i, DISTANCE])


@compiled(inline="always")
def put(chain: Any, i: int, point: Point, changed: bool) -> None:
    """Write a point of a chain."""
    chain[i, 0], chain[i, 1], chain[i, 2] = point.x, point.y, point.z
    chain[i, DISTANCE], chain[i, CHANGED] = point.distance, 1.0 if changed else 0.0


@compiled(inline="always")
def measured(x: float, y: float, z: float, packed: Any) -> Point:
    """Return the point at a position."""
    return Point(x, y, z, distance(x, y, z, packed))


@compiled(inline="always")
def apart(p: Any, q: Any) -> float:
    """Distance between two positions."""
    x, y, z = q.x - p.x, q.y - p.y, q.z - p.z
    return np.sqrt(x * x + y * y + z * z)


@compiled(inline="always")
def between(p: Any, q: Any, ratio: float) -> Vector:
    """Position on the way from p to q: p at ratio 0, q at ratio 1."""
    return Vector(p.x + ratio * (q.x - p.x), p.y + ratio * (q.y - p.y), p.z + ratio * (q.z - p.z))


@compiled(inline="always")
def size_of(vector: Vector) -> float:
    """Length of a displacement."""
    return np.sqrt(vector.x * vector.x + vector.y * vector.y + vector.z * vector.z)


@compiled
def chain_length(chain: Any, n: int) -> float:
    """Length of a chain of n points."""
    total = 0.0
    for i in range(n - 1):
        total += apart(point_at(chain, i), point_at(chain, i + 1))
    return total


@compiled
def pushed_out(position: Any, clearance: float, packed: Any) -> Point:
    """Move a position out of obstacles until it is ``clearance`` away, or nearly so."""
    x, y, z = position.x, position.y, position.z
    d, index = nearest_obstacle(x, y, z, packed)
    for _ in range(_MAX_PUSHES):
        if d >= clearance:
            break
        gx, gy, gz = gradient(x, y, z, packed, index)
        step = clearance + _MARGIN - d
        x, y, z = x + step * gx, y + step * gy, z + step * gz
        d, index = nearest_obstacle(x, y, z, packed)
    return Point(x, y, z, d)


@compiled
def first_uncovered(
    p: Point, q: Point, motion: Vector, at_p: float, at_q: float, packed: Any
) -> float:
    """Say how far along the segment from p to q its bubbles cover it.

    The end p came here by ``at_p`` times the displacement ``motion``, the end q by ``at_q`` times
    it, and points between them by shares between these. Bubbles have to cover the ways of all
    these points, so each counts as smaller by the way of its centre. Where it is nearer to
    obstacles than the floor, a segment may not get nearer still.

    Returns
    -------
    ratio : float
        Share of the segment, from p, that is covered; -1 if all of it is.
    """
    length = apart(p, q)
    if length <= 0.0:
        return -1.0
    swept = size_of(motion)
    slope = (at_q - at_p) / length
    shrink = 1.0 / (1.0 + swept * abs(slope))
    end = length - max(0.0, (q.distance - swept * at_q) * shrink)
    t, d = 0.0, p.distance
    for _ in range(_MAX_BUBBLES):
        share = at_p + slope * t
        bubble = (d - swept * share) * shrink
        if bubble < MIN_BUBBLE:
            break
        t += bubble
        if t >= end:
            return -1.0
        center = between(p, q, t / length)
        d = distance(center.x, center.y, center.z, packed)
        if d < FLOOR:
            share = at_p + slope * t
            x, y = center.x - share * motion.x, center.y - share * motion.y
            if d < distance(x, y, center.z - share * motion.z, packed):
                break
    return min(1.0, t / length)
