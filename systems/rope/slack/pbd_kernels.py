"""Compiled dynamics of the PBD rope: links that fall, hang and slide while the ends are moved.

Ropes that take the same steps are moved side by side, as lanes that come last in every array: each
link waits for the one before it, and meanwhile a processor can work on those of other ropes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.kernels import length_between
from systems.rope.obstacles.signed_distance_kernels import gradient, nearest_obstacle

# Strides and steps are those of Γ. What gravity adds to a free node's displacement from step to
# step, in metres, and the share of it that is kept, are MuJoCo's: 4 m/s² times 5 ms squared, and
# 0.95 every other step.
LONGEST_STRIDE = 0.005
STEPS_PER_STRIDE = 2
RESTING_STEPS = 4
FALL = 1e-4
KEPT = 0.975
SWEEPS = 2
# Rows in a chunk: of a few, a processor waits; hundreds no longer fit into its cache.
MOST_TOGETHER = 16


@compiled
def read_rope(row: Any, q: Any, points: Any, moved: Any, lane: int) -> None:
    """Read a PBD rope between grippers at ``q``: nodes, and their last displacements."""
    last = points.shape[0] - 1
    half = 3 * (last - 1)
    for k in range(3):
        points[0, k, lane], points[last, k, lane] = q[k], q[3 + k]
        for i in range(last - 1):
            points[i + 1, k, lane] = row[3 * i + k]
            moved[i + 1, k, lane] = row[half + 3 * i + k]


@compiled
def write_rope(points: Any, moved: Any, lane: int, row: Any) -> float:
    """Write what :func:`read_rope` reads; return how long the rope is."""
    last = points.shape[0] - 1
    half = 3 * (last - 1)
    for k in range(3):
        for i in range(last - 1):
            row[3 * i + k] = points[i + 1, k, lane]
            row[half + 3 * i + k] = moved[i + 1, k, lane]
    return length_between(points[::last, :, lane], points[1:last, :, lane])


@compiled(error_model="numpy")
def shorten_links(points: Any, i: int, spacing: float) -> None:
    """Pull two neighbours of each rope together until their link is no longer than it should be."""
    j, last = i + 1, points.shape[0] - 1
    # Grippers do not give way.
    near = 0.0 if i == 0 else (1.0 if j == last else 0.5)
    far = 0.0 if j == last else (1.0 if i == 0 else 0.5)
    for lane in range(points.shape[2]):
        x = points[j, 0, lane] - points[i, 0, lane]
        y = points[j, 1, lane] - points[i, 1, lane]
        z = points[j, 2, lane] - points[i, 2, lane]
        # Nodes at one place make this minus infinity, which numpy's way of dividing allows.
        excess = 1.0 - spacing / np.sqrt(x * x + y * y + z * z)
        excess = excess if excess > 0.0 else 0.0
        points[i, 0, lane] += near * excess * x
        points[i, 1, lane] += near * excess * y
        points[i, 2, lane] += near * excess * z
        points[j, 0, lane] -= far * excess * x
        points[j, 1, lane] -= far * excess * y
        points[j, 2, lane] -= far * excess * z


@compiled
def push_out(
    points: Any, i: int, lane: int, before: Any, friction: float, radius: float, packed: Any
) -> float:
    """Move a node out of the obstacles, and let it rub there; return how far from them it is."""
    x, y, z = points[i, 0, lane], points[i, 1, lane], points[i, 2, lane]
    d, index = nearest_obstacle(x, y, z, packed)
    if d >= radius:
        return d
    gx, gy, gz = gradient(x, y, z, packed[index])
    depth = radius - d
    x = x + depth * gx - before[i, 0, lane]
    y = y + depth * gy - before[i, 1, lane]
    z = z + depth * gz - before[i, 2, lane]
    away = x * gx + y * gy + z * gz
    u, v, w = x - away * gx, y - away * gy, z - away * gz
    slid = np.sqrt(u * u + v * v + w * w)
    held = 1.0 if slid <= friction * depth else friction * depth / slid
    points[i, 0, lane] = before[i, 0, lane] + x - held * u
    points[i, 1, lane] = before[i, 1, lane] + y - held * v
    points[i, 2, lane] = before[i, 2, lane] + z - held * w
    return radius


@compiled
def step_ropes(
    points: Any, moved: Any, before: Any, clear: Any, spacing: float, kinds: Any, packed: Any
) -> None:
    """Take one step; ``clear`` holds what each node surely is away from the obstacles."""
    last, n_lanes = points.shape[0] - 1, points.shape[2]
    for i in range(1, last):
        for k in range(3):
            fall = FALL if k == 2 else 0.0
            for lane in range(n_lanes):
                before[i, k, lane] = points[i, k, lane]
                points[i, k, lane] = points[i, k, lane] + moved[i, k, lane] - fall
    for _ in range(SWEEPS):
        for i in range(last):
            shorten_links(points, i, spacing)
        for i in range(last - 1, -1, -1):
            shorten_links(points, i, spacing)
    for i in range(1, last):
        for lane in range(n_lanes):
            x = points[i, 0, lane] - before[i, 0, lane]
            y = points[i, 1, lane] - before[i, 1, lane]
            z = points[i, 2, lane] - before[i, 2, lane]
            clear[i, lane] -= np.sqrt(x * x + y * y + z * z)
        for lane in range(n_lanes):
            friction, radius = kinds[lane % len(kinds)]
            if clear[i, lane] < radius:
                clear[i, lane] = push_out(points, i, lane, before, friction, radius, packed)
        for k in range(3):
            for lane in range(n_lanes):
                moved[i, k, lane] = KEPT * (points[i, k, lane] - before[i, k, lane])


@compiled
def move_together(
    points: Any,
    moved: Any,
    commands: Any,
    n_strides: int,
    spacing: float,
    kinds: Any,
    packed: Any,
) -> None:
    """Carry out commands of the grippers, one for each lane, in strides, then rest."""
    last, n_lanes = points.shape[0] - 1, points.shape[2]
    before, clear = points.copy(), np.zeros((last + 1, n_lanes))
    for stride in range(n_strides):
        share = (stride + 1) / n_strides
        for k in range(3):
            for lane in range(n_lanes):
                points[0, k, lane] = before[0, k, lane] + share * commands[k, lane]
                points[last, k, lane] = before[last, k, lane] + share * commands[3 + k, lane]
        for _ in range(STEPS_PER_STRIDE):
            step_ropes(points, moved, before, clear, spacing, kinds, packed)
    for _ in range(RESTING_STEPS):
        step_ropes(points, moved, before, clear, spacing, kinds, packed)


@compiled
def strides_of(command: Any) -> int:
    """Return how many strides a command of the grippers is carried out in."""
    longest = 0.0
    for k in (0, 3):
        square = command[k] ** 2 + command[k + 1] ** 2 + command[k + 2] ** 2
        longest = max(longest, np.sqrt(square))
    return max(1, int(np.ceil(longest / LONGEST_STRIDE - 1e-9)))


@compiled
def move_pbd_ropes(
    rows: Any,
    q: Any,
    commands: Any,
    valid: Any,
    spacing: float,
    longest: float,
    kinds: Any,
    packed: Any,
    n: int,
    out: Any,
) -> None:
    """Write where the PBD ropes of valid rows go; the others are copied.

    Rows in which a rope becomes longer than ``longest`` are not valid. ``q`` holds the grippers'
    positions before the commands, ``kinds`` the friction and the radius of each rope in a row;
    ``n`` counts nodes with both ends.
    """
    n_kinds, width = len(kinds), 6 * (n - 2)
    n_strides = np.zeros(len(rows), np.int64)
    for i in range(len(rows)):
        out[i] = rows[i]
        if valid[i]:
            n_strides[i] = strides_of(commands[i])
    for strides in range(1, n_strides.max() + 1 if len(rows) else 1):
        alike = np.flatnonzero(n_strides == strides)
        for first in range(0, len(alike), MOST_TOGETHER):
            together = alike[first : first + MOST_TOGETHER]
            n_lanes = n_kinds * len(together)
            points, moved = np.zeros((n, 3, n_lanes)), np.zeros((n, 3, n_lanes))
            moves = np.empty((6, n_lanes))
            for lane in range(n_lanes):
                i, kind = together[lane // n_kinds], lane % n_kinds
                moves[:, lane] = commands[i]
                read_rope(rows[i, kind * width : (kind + 1) * width], q[i], points, moved, lane)
            move_together(points, moved, moves, strides, spacing, kinds, packed)
            for lane in range(n_lanes):
                i, kind = together[lane // n_kinds], lane % n_kinds
                rope = out[i, kind * width : (kind + 1) * width]
                valid[i] &= write_rope(points, moved, lane, rope) <= longest
            for i in together:
                if not valid[i]:
                    out[i] = rows[i]
