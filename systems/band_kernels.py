"""Compiled contraction of an elastic band of bubbles.

A bubble is a point with its distance to the obstacles, so that the ball around it is free. A
band is a chain of bubbles, each overlapping the next, and so lies in free space between its
points too. Every change of a band is certified: the triangles that the band sweeps are covered
by bubbles, so that it cannot jump over an obstacle, and it never gets longer.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from systems.distance_kernels import (
    distance,
    distance_and_gradient,
    gradient,
    nearest_obstacle,
)

# The clearance is the rope's radius: points of a band keep it, the rope's centre line must.
CLEARANCE = 0.01
OVERLAP = 0.004
TOLERANCE = 1e-4

_REMOVAL_FACTOR = 1.35  # neighbours of a removed bubble overlap with this much to spare
_STEP_FACTOR = 0.9  # of a bubble's radius, in one move
_MAX_FILL = 40
_MAX_HALVINGS = 5
_MIN_GAIN = 1e-10
_MARGIN = 1e-7


@njit(cache=True, nogil=True, inline="always")
def bubble_at(chain: Any, i: int) -> tuple[float, float, float, float]:
    """Read point and radius of a bubble; chains have rows x, y, z, radius, changed."""
    return chain[i, 0], chain[i, 1], chain[i, 2], chain[i, 3]


@njit(cache=True, nogil=True, inline="always")
def put(chain: Any, i: int, bubble: Any, changed: float) -> None:
    """Write a bubble."""
    chain[i, 0], chain[i, 1], chain[i, 2] = bubble[0], bubble[1], bubble[2]
    chain[i, 3], chain[i, 4] = bubble[3], changed


@njit(cache=True, nogil=True, inline="always")
def apart(p: Any, q: Any) -> float:
    """Distance between the centres of two bubbles."""
    x, y, z = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    return np.sqrt(x * x + y * y + z * z)


@njit(cache=True, nogil=True)
def pushed_out(x: float, y: float, z: float, packed: Any) -> tuple[float, float, float, float]:
    """Return the bubble at a point, moved out of obstacles as far as the clearance asks."""
    d, index = nearest_obstacle(x, y, z, packed)
    for _ in range(8):
        if d >= CLEARANCE:
            break
        gx, gy, gz = gradient(x, y, z, packed[index])
        step = CLEARANCE + _MARGIN - d
        x, y, z = x + step * gx, y + step * gy, z + step * gz
        d, index = nearest_obstacle(x, y, z, packed)
    return x, y, z, d


@njit(cache=True, nogil=True)
def triangle_covered(a: Any, b: Any, c: Any) -> bool:
    """Say whether three bubbles cover the triangle between them, whose edges they cover.

    They leave a hole only around the point of equal power, where it lies in the triangle.
    """
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    uu, vv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
    uv = ux * vx + uy * vy + uz * vz
    det = uu * vv - uv * uv
    if det <= 1e-12 * uu * vv:
        return True
    ra = a[3] * a[3]
    p, q = 0.5 * (uu + ra - b[3] * b[3]), 0.5 * (vv + ra - c[3] * c[3])
    s, t = (p * vv - q * uv) / det, (q * uu - p * uv) / det
    if s <= 0.0 or t <= 0.0 or s + t >= 1.0:
        return True
    return s * s * uu + t * t * vv + 2.0 * s * t * uv <= ra


@njit(cache=True, nogil=True)
def link(last: Any, target: Any, gap: float, packed: Any) -> tuple[float, float, float, float]:
    """Return a bubble on the way to a target that overlaps the last one, or one too small."""
    # So far away, any bubble that keeps the clearance overlaps the last one; but around a
    # corner it is pushed aside, and has to be sought nearer.
    ratio = min(0.9, (last[3] + CLEARANCE - OVERLAP) / gap)
    for _ in range(_MAX_HALVINGS):
        bubble = pushed_out(
            last[0] + ratio * (target[0] - last[0]),
            last[1] + ratio * (target[1] - last[1]),
            last[2] + ratio * (target[2] - last[2]),
            packed,
        )
        if bubble[3] >= CLEARANCE and apart(last, bubble) + OVERLAP <= last[3] + bubble[3]:
            return bubble
        ratio *= 0.5
    return last[0], last[1], last[2], -1.0


@njit(cache=True, nogil=True)
def fill(chain: Any, n: int, target: Any, packed: Any) -> int:
    """Append bubbles to a chain of ``n`` until it overlaps ``target``; -1 if that fails."""
    for _ in range(_MAX_FILL):
        last = bubble_at(chain, n - 1)
        gap = apart(last, target)
        if gap + OVERLAP <= last[3] + target[3]:
            return n
        if n >= chain.shape[0] - 1:
            return -1
        bubble = link(last, target, gap, packed)
        if bubble[3] < CLEARANCE:
            return -1
        put(chain, n, bubble, 1.0)
        n += 1
    return -1


@njit(cache=True, nogil=True)
def sweeps_free_space(chain: Any, first: int, n: int, old: Any, following: Any) -> bool:
    """Say whether the band may move from ``old`` to chain[first:n] without a jump."""
    before = bubble_at(chain, first)
    for i in range(first + 1, n + 1):
        after = bubble_at(chain, i) if i < n else following
        if i < n and apart(old, after) > old[3] + after[3]:
            return False
        if not triangle_covered(before, old, after):
            return False
        before = after
    return True


@njit(cache=True, nogil=True)
def replace(chain: Any, n: int, old: Any, new: Any, following: Any, packed: Any) -> int:
    """Append ``new`` in place of ``old``, and what links it to its neighbours.

    Returns the chain's new length, or -1 if the band would get longer, break or jump.
    """
    first = n - 1
    before = bubble_at(chain, first)
    length = apart(before, old) + apart(old, following) - _MIN_GAIN
    if apart(before, new) + apart(new, following) >= length:
        return -1
    n = fill(chain, n, new, packed)
    if n < 0:
        return -1
    put(chain, n, new, 1.0)
    n = fill(chain, n + 1, following, packed)
    if n < 0:
        return -1
    for i in range(first, n - 1):
        length -= apart(bubble_at(chain, i), bubble_at(chain, i + 1))
    if length <= apart(bubble_at(chain, n - 1), following):
        return -1
    return n if sweeps_free_space(chain, first, n, old, following) else -1


@njit(cache=True, nogil=True)
def pull(before: Any, bubble: Any, after: Any, packed: Any) -> tuple[float, float, float]:
    """Return the way from a bubble to the chord of its neighbours, along what it touches."""
    cx, cy, cz = after[0] - before[0], after[1] - before[1], after[2] - before[2]
    wx, wy, wz = bubble[0] - before[0], bubble[1] - before[1], bubble[2] - before[2]
    square = cx * cx + cy * cy + cz * cz
    t = 0.0
    if square > 0.0:
        t = min(1.0, max(0.0, (wx * cx + wy * cy + wz * cz) / square))
    x, y, z = t * cx - wx, t * cy - wy, t * cz - wz
    if bubble[3] < CLEARANCE + TOLERANCE:
        _, gx, gy, gz = distance_and_gradient(bubble[0], bubble[1], bubble[2], packed)
        inward = min(0.0, x * gx + y * gy + z * gz)
        x, y, z = x - inward * gx, y - inward * gy, z - inward * gz
    return x, y, z


@njit(cache=True, nogil=True)
def move(
    chain: Any, n: int, bubble: Any, after: Any, packed: Any, moved_at_least: float
) -> tuple[int, bool]:
    """Append a bubble, pulled towards the chord; return the new length and whether it moved."""
    x, y, z = pull(bubble_at(chain, n - 1), bubble, after, packed)
    way = np.sqrt(x * x + y * y + z * z)
    if way > moved_at_least:
        scale = min(1.0, _STEP_FACTOR * bubble[3] / way)
        for _ in range(2):
            new = pushed_out(
                bubble[0] + scale * x, bubble[1] + scale * y, bubble[2] + scale * z, packed
            )
            if new[3] >= CLEARANCE:
                end = replace(chain, n, bubble, new, after, packed)
                if end > 0:
                    moved = end > n + 1 or apart(bubble, new) > moved_at_least
                    chain[end - 1, 4] = 1.0 if moved else 0.0
                    return end, moved
            scale *= 0.5
    put(chain, n, bubble, 0.0)
    return n + 1, False


@njit(cache=True, nogil=True)
def removable(before: Any, bubble: Any, after: Any) -> bool:
    """Say whether the band may cut straight from one neighbour of a bubble to the other."""
    if _REMOVAL_FACTOR * apart(before, after) + OVERLAP > before[3] + after[3]:
        return False
    return triangle_covered(before, bubble, after)


@njit(cache=True, nogil=True)
def sweep(source: Any, n: int, chain: Any, packed: Any, moved_at_least: float) -> tuple[int, bool]:
    """Contract the band once, from its last bubble to its first, which reverses it.

    Bubbles whose neighbourhood did not change since their last turn are left alone.
    """
    put(chain, 0, bubble_at(source, n - 1), 0.0)
    m, changed_before, any_changed = 1, source[n - 1, 4] > 0.0, False
    for i in range(n - 2, 0, -1):
        if m + 2 * _MAX_FILL + 2 > chain.shape[0]:
            return -1, False
        bubble, after = bubble_at(source, i), bubble_at(source, i - 1)
        if not (changed_before or source[i, 4] > 0.0 or source[i - 1, 4] > 0.0):
            put(chain, m, bubble, 0.0)
            m += 1
        elif removable(bubble_at(chain, m - 1), bubble, after):
            chain[m - 1, 4] = 1.0
            changed_before, any_changed = True, True
        else:
            m, changed_before = move(chain, m, bubble, after, packed, moved_at_least)
            any_changed = any_changed or changed_before
    put(chain, m, bubble_at(source, 0), 0.0)
    return m + 1, any_changed


@njit(cache=True, nogil=True)
def contract(chain: Any, spare: Any, n: int, packed: Any, max_sweeps: int) -> int:
    """Pull a band taut in place; return its number of bubbles, or -1 without room for them.

    Sweeps come in pairs, one from either end.
    """
    for _ in range((max_sweeps + 1) // 2):
        n, changed = sweep(chain, n, spare, packed, 0.1 * TOLERANCE)
        if n < 0:
            return -1
        n, changed_back = sweep(spare, n, chain, packed, 0.1 * TOLERANCE)
        if n < 0 or not (changed or changed_back):
            break
    return n


@njit(cache=True, nogil=True)
def start_chain(chain: Any, x: float, y: float, z: float, packed: Any) -> int:
    """Start a chain with the bubble of a gripper; -1 if the gripper is in collision."""
    radius = distance(x, y, z, packed)
    put(chain, 0, (x, y, z, radius), 1.0)
    return 1 if radius >= CLEARANCE else -1


@njit(cache=True, nogil=True)
def lengthen(chain: Any, n: int, x: float, y: float, z: float, packed: Any) -> int:
    """Link a chain to one more point that keeps the clearance; -1 if that fails."""
    if n < 0:
        return n
    bubble = pushed_out(x, y, z, packed)
    if bubble[3] < CLEARANCE:
        return -1
    if apart(bubble_at(chain, n - 1), bubble) < 1e-12:
        return n
    n = fill(chain, n, bubble, packed)
    if n < 0 or n >= chain.shape[0]:
        return -1
    put(chain, n, bubble, 1.0)
    return n + 1


@njit(cache=True, nogil=True)
def n_points(row: Any) -> int:
    """Count the points of a band's row; the last one fills what remains."""
    n = (row.shape[0] - 6) // 3
    while n > 2:
        end, before = 3 + 3 * n, 3 * n
        same = row[end] == row[before] and row[end + 1] == row[before + 1]
        if not (same and row[end + 2] == row[before + 2]):
            break
        n -= 1
    return n


@njit(cache=True, nogil=True)
def chain_length(chain: Any, n: int) -> float:
    """Length of a band."""
    total = 0.0
    for i in range(n - 1):
        total += apart(bubble_at(chain, i), bubble_at(chain, i + 1))
    return total


@njit(cache=True, nogil=True)
def write_row(chain: Any, n: int, row: Any) -> None:
    """Write a band as a row: gripper A, gripper B, its points, the last one repeated."""
    for k in range(3):
        row[k], row[3 + k] = chain[0, k], chain[n - 1, k]
    for i in range((row.shape[0] - 6) // 3):
        for k in range(3):
            row[6 + 3 * i + k] = chain[min(i, n - 1), k]


@njit(cache=True, nogil=True)
def propagate_row(
    row: Any, command: Any, packed: Any, max_length: float, chain: Any, spare: Any, out: Any
) -> bool:
    """Write g(row, command) to ``out``; False, and the row itself, where there is none."""
    out[:] = row
    ax, ay, az = row[0] + command[0], row[1] + command[1], row[2] + command[2]
    bx, by, bz = row[3] + command[3], row[4] + command[4], row[5] + command[5]
    if (bx - ax) ** 2 + (by - ay) ** 2 + (bz - az) ** 2 > max_length * max_length:
        return False
    n = start_chain(chain, ax, ay, az, packed)
    for i in range(n_points(row)):
        n = lengthen(chain, n, row[6 + 3 * i], row[7 + 3 * i], row[8 + 3 * i], packed)
    if n < 0 or distance(bx, by, bz, packed) < CLEARANCE:
        return False
    n = lengthen(chain, n, bx, by, bz, packed)
    if n < 0:
        return False
    n = contract(chain, spare, n, packed, 100)
    if n < 0 or n > (row.shape[0] - 6) // 3 or chain_length(chain, n) > max_length:
        return False
    write_row(chain, n, out)
    return True


@njit(cache=True, nogil=True)
def propagate_rows(
    rows: Any, commands: Any, packed: Any, max_length: float, workspace: Any, out: Any, valid: Any
) -> None:
    """Write g of each row and command."""
    for i in range(rows.shape[0]):
        valid[i] = propagate_row(
            rows[i], commands[i], packed, max_length, workspace[0], workspace[1], out[i]
        )


@njit(cache=True, nogil=True)
def reduce_points(points: Any, packed: Any, workspace: Any, out: Any) -> int:
    """Write r of a curve from gripper to gripper to ``out``; return 1, or a failure's code.

    -1: the curve passes through an obstacle; -2: the band has too many points for ``out``.
    """
    chain, last = workspace[0], points.shape[0] - 1
    n = start_chain(chain, points[0, 0], points[0, 1], points[0, 2], packed)
    for i in range(1, last + 1):
        n = lengthen(chain, n, points[i, 0], points[i, 1], points[i, 2], packed)
    if n < 0 or distance(points[last, 0], points[last, 1], points[last, 2], packed) < CLEARANCE:
        return -1
    n = contract(chain, workspace[1], n, packed, 300)
    if n < 0 or n > (out.shape[0] - 6) // 3:
        return -2
    write_row(chain, n, out)
    return 1
