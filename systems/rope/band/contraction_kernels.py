"""Compiled contraction of an elastic band.

A band is a polyline whose points know their distance to the obstacles. Every change of it is
certified by bubbles, balls as large as the distance at their centre: they cover the new
segments and the area that the old ones sweep on their way there. So a band lies in free space
all along, cannot jump over an obstacle, and never gets longer by a change.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.obstacles.signed_distance_kernels import (
    distance,
    distance_and_gradient,
    gradient,
    nearest_obstacle,
)

# Points keep the rope's radius away from obstacles, as its centre line must; segments may pass
# more closely, so that a corner needs few points.
CLEARANCE = 0.01
FLOOR = 0.006

_CONTACT = 1e-4  # so much farther away, a point still touches
_STEP_FACTOR = 0.9  # of the distance to the obstacles, in one move
_MIN_BUBBLE = 1e-3
_MAX_BUBBLES = 2000
_MIN_GAIN = 1e-10
_MIN_MOVE = 5e-5
_MARGIN = 1e-7
_N_TRIES = 3
_N_SLIDES = 2
_SLIDE_FACTOR = 1.1  # more than 1 leads away from the obstacle, and is not blocked again


@compiled(inline="always")
def point_at(chain: Any, i: int) -> tuple[float, float, float, float]:
    """Read a point and its distance; chains have rows x, y, z, distance, changed."""
    return chain[i, 0], chain[i, 1], chain[i, 2], chain[i, 3]


@compiled(inline="always")
def put(chain: Any, i: int, point: Any, changed: float) -> None:
    """Write a point and its distance."""
    chain[i, 0], chain[i, 1], chain[i, 2] = point[0], point[1], point[2]
    chain[i, 3], chain[i, 4] = point[3], changed


@compiled(inline="always")
def apart(p: Any, q: Any) -> float:
    """Distance between two points."""
    x, y, z = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    return np.sqrt(x * x + y * y + z * z)


@compiled(inline="always")
def between(p: Any, q: Any, ratio: float) -> tuple[float, float, float]:
    """Point on the way from one point to another."""
    return (
        p[0] + ratio * (q[0] - p[0]),
        p[1] + ratio * (q[1] - p[1]),
        p[2] + ratio * (q[2] - p[2]),
    )


@compiled
def pushed_out(place: Any, clearance: float, packed: Any) -> tuple[float, float, float, float]:
    """Return a point with its distance, moved out of obstacles as far as asked."""
    x, y, z = place[0], place[1], place[2]
    d, index = nearest_obstacle(x, y, z, packed)
    for _ in range(8):
        if d >= clearance:
            break
        gx, gy, gz = gradient(x, y, z, packed[index])
        step = clearance + _MARGIN - d
        x, y, z = x + step * gx, y + step * gy, z + step * gz
        d, index = nearest_obstacle(x, y, z, packed)
    return x, y, z, d


@compiled
def blocked_at(p: Any, q: Any, way: Any, at_p: float, at_q: float, packed: Any) -> float:
    """Say how far along a segment its bubbles leave it uncovered; -1 if nowhere.

    The segment came here by ``way`` times a number that goes from ``at_p`` to ``at_q`` along
    it. A bubble holds the ways of all its points if it is larger by as much. Nearer than the
    floor a segment may not get nearer still.
    """
    length = apart(p, q)
    if length <= 0.0:
        return -1.0
    swept = np.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
    slope = (at_q - at_p) / length
    shrink = 1.0 / (1.0 + swept * abs(slope))
    end = length - max(0.0, (q[3] - swept * at_q) * shrink)
    t, d = 0.0, p[3]
    for _ in range(_MAX_BUBBLES):
        part = at_p + slope * t
        bubble = (d - swept * part) * shrink
        if bubble < _MIN_BUBBLE:
            break
        t += bubble
        if t >= end:
            return -1.0
        x, y, z = between(p, q, t / length)
        d = distance(x, y, z, packed)
        if d < FLOOR:
            part = at_p + slope * t
            x, y, z = x - part * way[0], y - part * way[1], z - part * way[2]
            if d < distance(x, y, z, packed):
                break
    return min(1.0, t / length)


@compiled
def bent_blocked_at(before: Any, old: Any, new: Any, after: Any, packed: Any) -> float:
    """Say where the segments at a point that moved are blocked; -1 if nowhere.

    Up to 1 it is on the segment before the point, from 1 on the one after it.
    """
    way = new[0] - old[0], new[1] - old[1], new[2] - old[2]
    blocked = blocked_at(before, new, way, 0.0, 1.0, packed)
    if blocked >= 0.0:
        return min(blocked, 0.999)
    blocked = blocked_at(new, after, way, 1.0, 0.0, packed)
    return 1.0 + blocked if blocked >= 0.0 else -1.0


@compiled
def pull(before: Any, point: Any, after: Any, packed: Any) -> tuple[float, float, float]:
    """Return the way on which a point shortens the band most, along what it touches.

    It is the sum of the directions to its neighbours, as long as Newton's method makes it:
    in free space it ends on their chord.
    """
    a, b = apart(before, point), apart(point, after)
    if a <= 0.0 or b <= 0.0:
        return 0.0, 0.0, 0.0
    x, y, z = between(before, after, a / (a + b))
    x, y, z = x - point[0], y - point[1], z - point[2]
    if point[3] < CLEARANCE + _CONTACT:
        _, gx, gy, gz = distance_and_gradient(point[0], point[1], point[2], packed)
        inward = min(0.0, x * gx + y * gy + z * gz)
        x, y, z = x - inward * gx, y - inward * gy, z - inward * gz
    return x, y, z


@compiled
def removable(before: Any, point: Any, after: Any, packed: Any) -> bool:
    """Say whether the band may cut straight from one neighbour of a point to the other."""
    a, b = apart(before, point), apart(point, after)
    if a <= 0.0 or b <= 0.0:
        return True
    x, y, z = between(before, after, a / (a + b))
    middle = x, y, z, distance(x, y, z, packed)
    if middle[3] < min(FLOOR, point[3]) or middle[3] - apart(point, middle) < _MIN_BUBBLE:
        return False
    return bent_blocked_at(before, point, middle, after, packed) < 0.0


@compiled
def bent_segment(p: Any, q: Any, ratio: float, packed: Any) -> tuple[float, float, float, float]:
    """Return a point of a segment, pushed out to the clearance; its distance is -1 if it cannot."""
    place = between(p, q, ratio)
    point = pushed_out(place, CLEARANCE, packed)
    if point[3] >= CLEARANCE and bent_blocked_at(p, place, point, q, packed) < 0.0:
        return point
    return place[0], place[1], place[2], -1.0


@compiled
def moved_by(point: Any, way: Any, scale: float, packed: Any) -> tuple[float, float, float, float]:
    """Return a point moved along a way, but not nearer to obstacles than it may be."""
    far = np.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
    if far > _STEP_FACTOR * point[3]:
        scale *= _STEP_FACTOR * point[3] / far
    place = point[0] + scale * way[0], point[1] + scale * way[1], point[2] + scale * way[2]
    return pushed_out(place, min(CLEARANCE, point[3]), packed)


@compiled
def slide(
    before: Any, tried: Any, after: Any, way: Any, blocked: float, packed: Any
) -> tuple[float, float, float]:
    """Take from a way what presses a segment against the obstacle that blocks it."""
    if blocked < 1.0:
        x, y, z = between(before, tried, blocked)
    else:
        x, y, z = between(tried, after, blocked - 1.0)
    _, gx, gy, gz = distance_and_gradient(x, y, z, packed)
    inward = _SLIDE_FACTOR * min(0.0, way[0] * gx + way[1] * gy + way[2] * gz)
    return way[0] - inward * gx, way[1] - inward * gy, way[2] - inward * gz


@compiled
def bend_and_move(
    chain: Any, n: int, point: Any, new: Any, after: Any, blocked: float, packed: Any
) -> int:
    """Move a point one of whose segments is blocked, and bend that segment there."""
    before = point_at(chain, n - 1)
    length = apart(before, point) + apart(point, after) - _MIN_GAIN
    if blocked < 1.0:
        bend = bent_segment(before, point, blocked, packed)
        bent = apart(before, bend) + apart(bend, new) + apart(new, after)
        first, second, start, end = bend, new, bend, after
    else:
        bend = bent_segment(point, after, blocked - 1.0, packed)
        bent = apart(before, new) + apart(new, bend) + apart(bend, after)
        first, second, start, end = new, bend, before, bend
    if bend[3] < 0.0 or bent >= length:
        return -1
    if bent_blocked_at(start, point, new, end, packed) >= 0.0:
        return -1
    put(chain, n, first, 1.0)
    put(chain, n + 1, second, 1.0)
    return n + 2


@compiled
def try_way(
    chain: Any, n: int, point: Any, after: Any, way: Any, packed: Any
) -> tuple[int, float, Any]:
    """Append a point moved along a way, as far as it shortens the band and is not blocked.

    Returns the chain's new length or -1, where a segment was blocked last and by which move.
    """
    before = point_at(chain, n - 1)
    length = apart(before, point) + apart(point, after) - _MIN_GAIN
    scale, blocked, tried = 1.0, -1.0, point
    for _ in range(_N_TRIES):
        new = moved_by(point, way, scale, packed)
        scale *= 0.5
        sweep = apart(point, new)
        if sweep <= _MIN_MOVE:
            break
        if new[3] < min(CLEARANCE, point[3]) or apart(before, new) + apart(new, after) >= length:
            continue
        blocked, tried = bent_blocked_at(before, point, new, after, packed), new
        if blocked < 0.0:
            put(chain, n, new, 1.0)
            return n + 1, blocked, tried
    return -1, blocked, tried


@compiled
def move(chain: Any, n: int, point: Any, after: Any, packed: Any) -> tuple[int, bool]:
    """Append a point, pulled taut; return the chain's new length and whether it moved."""
    before = point_at(chain, n - 1)
    way = pull(before, point, after, packed)
    end, blocked, tried = try_way(chain, n, point, after, way, packed)
    if end < 0 and blocked >= 0.0:
        end = bend_and_move(chain, n, point, tried, after, blocked, packed)
    for _ in range(_N_SLIDES):
        if end > 0 or blocked < 0.0:
            break
        way = slide(before, tried, after, way, blocked, packed)
        end, blocked, tried = try_way(chain, n, point, after, way, packed)
    if end > 0:
        return end, True
    put(chain, n, point, 0.0)
    return n + 1, False


@compiled
def sweep(source: Any, n: int, chain: Any, packed: Any) -> tuple[int, bool]:
    """Contract the band once, from its last point to its first, which reverses it.

    Points whose neighbourhood did not change since their last turn are left alone.
    """
    put(chain, 0, point_at(source, n - 1), 0.0)
    m, changed_before, any_changed = 1, source[n - 1, 4] > 0.0, False
    for i in range(n - 2, 0, -1):
        if m + 3 > chain.shape[0]:
            return -1, False
        point, after = point_at(source, i), point_at(source, i - 1)
        if not (changed_before or source[i, 4] > 0.0 or source[i - 1, 4] > 0.0):
            put(chain, m, point, 0.0)
            m += 1
        elif removable(point_at(chain, m - 1), point, after, packed):
            chain[m - 1, 4] = 1.0
            changed_before, any_changed = True, True
        else:
            m, changed_before = move(chain, m, point, after, packed)
            any_changed = any_changed or changed_before
    put(chain, m, point_at(source, 0), 0.0)
    return m + 1, any_changed


@compiled
def contract(chain: Any, spare: Any, n: int, packed: Any, max_sweeps: int) -> int:
    """Pull a band taut in place; return its number of points, or -1 without room for them.

    Sweeps come in pairs, one from either end.
    """
    for _ in range((max_sweeps + 1) // 2):
        n, changed = sweep(chain, n, spare, packed)
        if n < 0:
            return -1
        n, changed_back = sweep(spare, n, chain, packed)
        if n < 0 or not (changed or changed_back):
            break
    return n
