"""Compiled steps from ropes and bands to bands: the reduction r and the dynamics g.

Both lay a chain of points from gripper to gripper and then let it contract. For r the chain
follows the rope. For g it follows the band before the command, with a segment at either end to
where the gripper has gone.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.band.chain_kernels import (
    CHAIN_WIDTH,
    CLEARANCE,
    NO_MOTION,
    Vector,
    apart,
    between,
    chain_length,
    first_uncovered,
    measured,
    point_at,
    pushed_out,
    put,
)
from systems.rope.band.contraction_kernels import contract
from systems.rope.band.row_kernels import read_points, room_for_points, write_band

# Why a rope can't be reduced.
IN_OBSTACLE, TOO_MANY_POINTS = -1, -2

_MOST_CHAIN_POINTS = 640
_G_SWEEPS = 100
_R_SWEEPS = 300
_MAX_LINKS = 20
_LEAST_LINK = 0.05  # share of the way to a point; a shorter piece of it is no way there
_SAME_PLACE = 1e-12  # metres


@compiled
def link(chain: Any, n: int, position: Vector, packed: Any) -> int:
    """Append a position, pushed out of obstacles, and the bends that it takes to get there.

    Returns the chain's new number of points, or -1 if there is no way or no room.
    """
    if n < 0:
        return n
    target = pushed_out(position, CLEARANCE, packed)
    if target.distance < CLEARANCE:
        return -1
    for _ in range(_MAX_LINKS):
        last = point_at(chain, n - 1)
        if apart(last, target) < _SAME_PLACE:
            return n
        if n + 1 >= chain.shape[0]:
            return -1
        ratio, bend = 1.0, target
        while (
            ratio > _LEAST_LINK and first_uncovered(last, bend, NO_MOTION, 0.0, 0.0, packed) >= 0.0
        ):
            ratio *= 0.5
            bend = pushed_out(between(last, target, ratio), CLEARANCE, packed)
        if ratio <= _LEAST_LINK or bend.distance < CLEARANCE:
            return -1
        put(chain, n, bend, True)
        n += 1
        if ratio == 1.0:
            return n
    return -1


@compiled
def start_chain(chain: Any, a: Vector, packed: Any) -> int:
    """Start a chain at gripper A; return 1, or -1 if the gripper is in collision."""
    start = measured(a.x, a.y, a.z, packed)
    put(chain, 0, start, True)
    return 1 if start.distance >= CLEARANCE else -1


@compiled
def drag_ends(points: Any, m: int, a: Vector, b: Vector, packed: Any, chain: Any) -> int:
    """Lay a chain from gripper A over the m points of a band to gripper B.

    Returns its number of points, or -1 where a gripper is in collision or can't be linked.
    """
    n = start_chain(chain, a, packed)
    n = link(chain, n, Vector(points[0, 0], points[0, 1], points[0, 2]), packed)
    if n < 0 or measured(b.x, b.y, b.z, packed).distance < CLEARANCE:
        return -1
    for i in range(1, m):
        put(chain, n, measured(points[i, 0], points[i, 1], points[i, 2], packed), True)
        n += 1
    return link(chain, n, b, packed)


@compiled
def propagate_band(
    row: Any, command: Any, packed: Any, max_length: float, chain: Any, spare: Any, out: Any
) -> bool:
    """Write g of a row and a command; return False, leaving ``out``, where there is none."""
    a = Vector(row[0] + command[0], row[1] + command[1], row[2] + command[2])
    b = Vector(row[3] + command[3], row[4] + command[4], row[5] + command[5])
    if (b.x - a.x) ** 2 + (b.y - a.y) ** 2 + (b.z - a.z) ** 2 > max_length * max_length:
        return False
    m = read_points(row, spare)
    n = drag_ends(spare, m, a, b, packed, chain)
    if n < 0:
        return False
    n = contract(chain, spare, n, packed, _G_SWEEPS)
    if n < 0 or n > room_for_points(row) or chain_length(chain, n) > max_length:
        return False
    write_band(chain, n, out)
    return True


@compiled
def propagate_bands(
    bands: Any, commands: Any, allowed: Any, packed: Any, max_length: float
) -> tuple[Any, Any]:
    """Move the ends of bands and let the bands contract: the paper's g, without the grippers.

    Parameters
    ----------
    bands : ndarray of shape (n, reduced_dim)
    commands : ndarray of shape (n, 6)
        Displacements of gripper A and gripper B, metres.
    allowed : ndarray of bool of shape (n,)
        Commands that are carried out.
    packed : ndarray of shape (n_rows, 8)
    max_length : float
        Largest length of a band, metres.

    Returns
    -------
    next_bands : ndarray of shape (n, reduced_dim)
    valid : ndarray of bool of shape (n,)
        False, with the band left as it was, where the command is not allowed, the band would be
        overstretched, a gripper would be in collision or the band can't be linked to it.

    References
    ----------
    McConachie et al. 2020, "Reduction"; Quinlan 1994.
    """
    next_bands, valid = bands.copy(), allowed.copy()
    chain = np.empty((_MOST_CHAIN_POINTS, CHAIN_WIDTH))
    spare = np.empty((_MOST_CHAIN_POINTS, CHAIN_WIDTH))
    for i in range(bands.shape[0]):
        valid[i] = valid[i] and propagate_band(
            bands[i], commands[i], packed, max_length, chain, spare, next_bands[i]
        )
    return next_bands, valid


@compiled
def reduce_curve(curve: Any, packed: Any, out: Any) -> int:
    """Pull a curve from gripper to gripper taut: the paper's r.

    Parameters
    ----------
    curve : ndarray of shape (n, 3)
    packed : ndarray of shape (n_rows, 8)
    out : ndarray of shape (reduced_dim,)
        The band is written here.

    Returns
    -------
    failure : int
        0 if there is none, else IN_OBSTACLE or TOO_MANY_POINTS.
    """
    chain = np.empty((_MOST_CHAIN_POINTS, CHAIN_WIDTH))
    spare = np.empty((_MOST_CHAIN_POINTS, CHAIN_WIDTH))
    n = start_chain(chain, Vector(curve[0, 0], curve[0, 1], curve[0, 2]), packed)
    for i in range(1, curve.shape[0]):
        n = link(chain, n, Vector(curve[i, 0], curve[i, 1], curve[i, 2]), packed)
    end = curve[curve.shape[0] - 1]
    if n < 0 or measured(end[0], end[1], end[2], packed).distance < CLEARANCE:
        return IN_OBSTACLE
    n = contract(chain, spare, n, packed, _R_SWEEPS)
    if n < 0 or n > room_for_points(out):
        return TOO_MANY_POINTS
    write_band(chain, n, out)
    return 0
