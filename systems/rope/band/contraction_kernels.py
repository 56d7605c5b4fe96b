r"""Compiled contraction of an elastic band: pulling it taut without crossing an obstacle.

The band is a chain of points (see :mod:`systems.rope.band.chain_kernels`) that is swept from end
to end, point by point, until a sweep changes nothing. A point between its neighbours ``before``
and ``after`` takes its turn as follows:

1. If the band may cut straight from ``before`` to ``after``, the point is removed.
2. Else it is pulled towards the straight line between them, as far as that shortens the band::

      before . . . . . . . after
           \       ^      /
            \      |pull /
             \     |    /
              `---point'

3. If an obstacle is in the way of one of the two segments, that segment is bent around the obstacle
   by a new point::

      before . [########]. after
           \   [########]  /
            bend---------new

4. Else the point slides along the obstacle: it is pulled only in the directions that do not press
   the segment against it.

Every change is certified by bubbles, balls as large as the distance to the obstacles at their
centre: they have to cover the new segments and the area that the old ones sweep on their way
there. So a band lies in free space all along, can't jump over an obstacle, which keeps it in its
homotopy class, and never gets longer by a change.

References
----------
Quinlan 1994, "Real-time modification of collision-free paths".
"""

from __future__ import annotations

from typing import Any, NamedTuple

from systems.compilation import compiled
from systems.rope.band.chain_kernels import (
    CHANGED,
    CLEARANCE,
    FLOOR,
    MIN_BUBBLE,
    Point,
    Vector,
    apart,
    between,
    first_uncovered,
    measured,
    point_at,
    pushed_out,
    put,
    size_of,
)
from systems.rope.obstacles.signed_distance_kernels import distance_and_gradient

_CONTACT = 1e-4  # metres beyond the clearance at which a point still touches an obstacle
_STEP_FACTOR = 0.9  # longest move of a point, as a share of its distance to the obstacles
_MIN_GAIN = 1e-10  # metres by which a change has to shorten the band
_MIN_MOVE = 5e-5  # metres; shorter moves are not tried
_N_TRIES = 3  # moves along one direction, each half as long as the one before
_N_SLIDES = 2
_SLIDE_FACTOR = 1.1  # more than 1 leads away from the obstacle, so as not to be blocked again
_LAST_BEFORE_POINT = 0.999  # a segment that is blocked at its end is bent a little before it


class Blockage(NamedTuple):
    """Where the two segments at a point that moved are first not covered by bubbles."""

    found: bool
    after_point: bool  # on the segment from the point on, not on the one that leads to it
    ratio: float  # how far along that segment


FREE = Blockage(False, False, 0.0)


@compiled
def find_blockage(before: Point, old: Point, new: Point, after: Point, packed: Any) -> Blockage:
    """Say where the segments at a point that moved from ``old`` to ``new`` are blocked."""
    motion = Vector(new.x - old.x, new.y - old.y, new.z - old.z)
    ratio = first_uncovered(before, new, motion, 0.0, 1.0, packed)
    if ratio >= 0.0:
        return Blockage(True, False, min(ratio, _LAST_BEFORE_POINT))
    ratio = first_uncovered(new, after, motion, 1.0, 0.0, packed)
    # The sum rounds the ratio to a multiple of 2^-52, as it was rounded when the shipped models'
    # data were collected.
    return Blockage(ratio >= 0.0, True, (1.0 + ratio) - 1.0)


@compiled
def pull_of(before: Point, point: Point, after: Point, packed: Any) -> Vector:
    """Return the displacement on which a point shortens the band most.

    It is the sum of the directions to the point's neighbours, as long as Newton's method makes it:
    in free space it ends on the straight line between them. At an obstacle it leads along the
    surface.
    """
    a, b = apart(before, point), apart(point, after)
    if a <= 0.0 or b <= 0.0:
        return Vector(0.0, 0.0, 0.0)
    target = between(before, after, a / (a + b))
    x, y, z = target.x - point.x, target.y - point.y, target.z - point.z
    if point.distance < CLEARANCE + _CONTACT:
        _, gx, gy, gz = distance_and_gradient(point.x, point.y, point.z, packed)
        inward = min(0.0, x * gx + y * gy + z * gz)
        x, y, z = x - inward * gx, y - inward * gy, z - inward * gz
    return Vector(x, y, z)


@compiled
def removable(before: Point, point: Point, after: Point, packed: Any) -> bool:
    """Say whether the band may cut straight from one neighbour of a point to the other."""
    a, b = apart(before, point), apart(point, after)
    if a <= 0.0 or b <= 0.0:
        return True
    position = between(before, after, a / (a + b))
    middle = measured(position.x, position.y, position.z, packed)
    if middle.distance < min(FLOOR, point.distance):
        return False
    if middle.distance - apart(point, middle) < MIN_BUBBLE:
        return False
    return not find_blockage(before, point, middle, after, packed).found


@compiled
def bent_segment(p: Point, q: Point, ratio: float, packed: Any) -> Point:
    """Return a point of a segment, pushed out to the clearance; its distance is -1 if it can't."""
    old = between(p, q, ratio)
    bend = pushed_out(old, CLEARANCE, packed)
    unmeasured = Point(old.x, old.y, old.z, -1.0)
    if bend.distance < CLEARANCE or find_blockage(p, unmeasured, bend, q, packed).found:
        return unmeasured
    return bend


@compiled
def moved_by(point: Point, way: Vector, scale: float, packed: Any) -> Point:
    """Return a point moved along ``scale * way``, but not nearer to obstacles than it may be."""
    far = size_of(way)
    if far > _STEP_FACTOR * point.distance:
        scale *= _STEP_FACTOR * point.distance / far
    target = Vector(point.x + scale * way.x, point.y + scale * way.y, point.z + scale * way.z)
    return pushed_out(target, min(CLEARANCE, point.distance), packed)


@compiled
def slide(
    before: Point, tried: Point, after: Point, way: Vector, blockage: Blockage, packed: Any
) -> Vector:
    """Take out of a way what presses a segment against the obstacle that blocks it."""
    if blockage.after_point:
        contact = between(tried, after, blockage.ratio)
    else:
        contact = between(before, tried, blockage.ratio)
    _, gx, gy, gz = distance_and_gradient(contact.x, contact.y, contact.z, packed)
    inward = _SLIDE_FACTOR * min(0.0, way.x * gx + way.y * gy + way.z * gz)
    return Vector(way.x - inward * gx, way.y - inward * gy, way.z - inward * gz)


@compiled
def bend_and_move(
    chain: Any, n: int, point: Point, new: Point, after: Point, blockage: Blockage, packed: Any
) -> int:
    """Append a point that moved and a bend of the segment that is blocked.

    Returns the chain's new number of points, or -1 if that does not shorten the band or is
    blocked, too.
    """
    before = point_at(chain, n - 1)
    length = apart(before, point) + apart(point, after) - _MIN_GAIN
    if blockage.after_point:
        bend = bent_segment(point, after, blockage.ratio, packed)
        bent = apart(before, new) + apart(new, bend) + apart(bend, after)
        first, second, start, end = new, bend, before, bend
    else:
        bend = bent_segment(before, point, blockage.ratio, packed)
        bent = apart(before, bend) + apart(bend, new) + apart(new, after)
        first, second, start, end = bend, new, bend, after
    if bend.distance < 0.0 or bent >= length:
        return -1
    if find_blockage(start, point, new, end, packed).found:
        return -1
    put(chain, n, first, True)
    put(chain, n + 1, second, True)
    return n + 2


@compiled
def try_way(
    chain: Any, n: int, point: Point, after: Point, way: Vector, packed: Any
) -> tuple[int, Blockage, Point]:
    """Append a point moved along a way, as far as that shortens the band and is not blocked.

    Returns the chain's new number of points, or -1 if no move will do, what blocked the last move
    that was tried, and where that move led.
    """
    before = point_at(chain, n - 1)
    length = apart(before, point) + apart(point, after) - _MIN_GAIN
    scale, blockage, tried = 1.0, FREE, point
    for _ in range(_N_TRIES):
        new = moved_by(point, way, scale, packed)
        scale *= 0.5
        if apart(point, new) <= _MIN_MOVE:
            break
        longer = apart(before, new) + apart(new, after) >= length
        if longer or new.distance < min(CLEARANCE, point.distance):
            continue
        blockage, tried = find_blockage(before, point, new, after, packed), new
        if not blockage.found:
            put(chain, n, new, True)
            return n + 1, blockage, tried
    return -1, blockage, tried


@compiled
def pull_taut(chain: Any, n: int, point: Point, after: Point, packed: Any) -> tuple[int, bool]:
    """Append a point, pulled taut; return the chain's number of points and whether it moved."""
    before = point_at(chain, n - 1)
    way = pull_of(before, point, after, packed)
    end, blockage, tried = try_way(chain, n, point, after, way, packed)
    if end < 0 and blockage.found:
        end = bend_and_move(chain, n, point, tried, after, blockage, packed)
    for _ in range(_N_SLIDES):
        if end > 0 or not blockage.found:
            break
        way = slide(before, tried, after, way, blockage, packed)
        end, blockage, tried = try_way(chain, n, point, after, way, packed)
    if end > 0:
        return end, True
    put(chain, n, point, False)
    return n + 1, False


@compiled
def sweep(source: Any, n: int, chain: Any, packed: Any) -> tuple[int, bool]:
    """Contract a band once, from its last point to its first, which reverses it.

    Points whose neighbourhood did not change since their last turn are only copied. Returns the
    number of points, or -1 without room for them, and whether anything changed.
    """
    put(chain, 0, point_at(source, n - 1), False)
    m, changed_before, any_changed = 1, source[n - 1, CHANGED] > 0.0, False
    for i in range(n - 2, 0, -1):
        if m + 3 > chain.shape[0]:
            return -1, False
        point, after = point_at(source, i), point_at(source, i - 1)
        if not (changed_before or source[i, CHANGED] > 0.0 or source[i - 1, CHANGED] > 0.0):
            put(chain, m, point, False)
            m += 1
        elif removable(point_at(chain, m - 1), point, after, packed):
            chain[m - 1, CHANGED] = 1.0
            changed_before, any_changed = True, True
        else:
            m, changed_before = pull_taut(chain, m, point, after, packed)
            any_changed = any_changed or changed_before
    put(chain, m, point_at(source, 0), False)
    return m + 1, any_changed


@compiled
def contract(chain: Any, spare: Any, n: int, packed: Any, max_sweeps: int) -> int:
    """Pull a band taut in place; return its number of points, or -1 without room for them.

    Sweeps come in pairs, one from either end, with ``spare`` as the chain in between.
    """
    for _ in range((max_sweeps + 1) // 2):
        n, changed = sweep(chain, n, spare, packed)
        if n < 0:
            return -1
        n, changed_back = sweep(spare, n, chain, packed)
        if n < 0 or not (changed or changed_back):
            break
    return n
