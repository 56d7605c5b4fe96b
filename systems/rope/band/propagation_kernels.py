"""Compiled steps from ropes and bands to bands: the reduction r and the dynamics g."""

from __future__ import annotations

from typing import Any

from systems.compilation import compiled
from systems.rope.band.contraction_kernels import (
    CLEARANCE,
    apart,
    between,
    blocked_at,
    contract,
    point_at,
    pushed_out,
    put,
)
from systems.rope.obstacles.signed_distance_kernels import distance

_G_SWEEPS = 100
_R_SWEEPS = 300
_MAX_LINKS = 20
_NO_WAY = (0.0, 0.0, 0.0)


@compiled
def start_chain(chain: Any, x: float, y: float, z: float, packed: Any) -> int:
    """Start a chain with a gripper's position; -1 if the gripper is in collision."""
    d = distance(x, y, z, packed)
    put(chain, 0, (x, y, z, d), 1.0)
    return 1 if d >= CLEARANCE else -1


@compiled
def append(chain: Any, n: int, x: float, y: float, z: float, packed: Any) -> int:
    """Append a point that is known to be linked to the last one."""
    put(chain, n, (x, y, z, distance(x, y, z, packed)), 1.0)
    return n + 1


@compiled
def link(chain: Any, n: int, x: float, y: float, z: float, packed: Any) -> int:
    """Append a point, pushed out, and what it takes to get there; -1 if that fails."""
    if n < 0:
        return n
    target = pushed_out((x, y, z), CLEARANCE, packed)
    if target[3] < CLEARANCE:
        return -1
    for _ in range(_MAX_LINKS):
        last = point_at(chain, n - 1)
        if apart(last, target) < 1e-12:
            return n
        if n + 1 >= chain.shape[0]:
            return -1
        ratio, bend = 1.0, target
        while ratio > 0.05 and blocked_at(last, bend, _NO_WAY, 0.0, 0.0, packed) >= 0.0:
            ratio *= 0.5
            bend = pushed_out(between(last, target, ratio), CLEARANCE, packed)
        if ratio <= 0.05 or bend[3] < CLEARANCE:
            return -1
        put(chain, n, bend, 1.0)
        n += 1
        if ratio == 1.0:
            return n
    return -1


@compiled
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


@compiled
def chain_length(chain: Any, n: int) -> float:
    """Length of a band."""
    total = 0.0
    for i in range(n - 1):
        total += apart(point_at(chain, i), point_at(chain, i + 1))
    return total


@compiled
def write_row(chain: Any, n: int, row: Any) -> None:
    """Write a band as a row: gripper A, gripper B, its points, the last one repeated."""
    for k in range(3):
        row[k], row[3 + k] = chain[0, k], chain[n - 1, k]
    for i in range((row.shape[0] - 6) // 3):
        for k in range(3):
            row[6 + 3 * i + k] = chain[min(i, n - 1), k]


@compiled
def propagate_row(
    row: Any, command: Any, packed: Any, max_length: float, chain: Any, spare: Any, out: Any
) -> bool:
    """Write g(row, command) to ``out``; False, and the row itself, where there is none."""
    out[:] = row
    ax, ay, az = row[0] + command[0], row[1] + command[1], row[2] + command[2]
    bx, by, bz = row[3] + command[3], row[4] + command[4], row[5] + command[5]
    if (bx - ax) ** 2 + (by - ay) ** 2 + (bz - az) ** 2 > max_length * max_length:
        return False
    # The old ends become points between the new ones.
    n, m = start_chain(chain, ax, ay, az, packed), n_points(row)
    n = link(chain, n, row[6], row[7], row[8], packed)
    if n < 0 or distance(bx, by, bz, packed) < CLEARANCE:
        return False
    for i in range(1, m):
        n = append(chain, n, row[6 + 3 * i], row[7 + 3 * i], row[8 + 3 * i], packed)
    n = link(chain, n, bx, by, bz, packed)
    if n < 0:
        return False
    n = contract(chain, spare, n, packed, _G_SWEEPS)
    if n < 0 or n > (row.shape[0] - 6) // 3 or chain_length(chain, n) > max_length:
        return False
    write_row(chain, n, out)
    return True


@compiled
def propagate_rows(
    rows: Any, commands: Any, packed: Any, max_length: float, workspace: Any, out: Any, valid: Any
) -> None:
    """Write g of each row and command."""
    for i in range(rows.shape[0]):
        valid[i] = propagate_row(
            rows[i], commands[i], packed, max_length, workspace[0], workspace[1], out[i]
        )


@compiled
def reduce_points(points: Any, packed: Any, workspace: Any, out: Any) -> int:
    """Write r of a curve from gripper to gripper to ``out``; return 1, or a failure's code.

    -1: the curve passes through an obstacle; -2: the band has too many points for ``out``.
    """
    chain, last = workspace[0], points.shape[0] - 1
    n = start_chain(chain, points[0, 0], points[0, 1], points[0, 2], packed)
    for i in range(1, last + 1):
        n = link(chain, n, points[i, 0], points[i, 1], points[i, 2], packed)
    if n < 0 or distance(points[last, 0], points[last, 1], points[last, 2], packed) < CLEARANCE:
        return -1
    n = contract(chain, workspace[1], n, packed, _R_SWEEPS)
    if n < 0 or n > (out.shape[0] - 6) // 3:
        return -2
    write_row(chain, n, out)
    return 1
