"""Compiled features of the rope: how near obstacles are below the band, and at the PBD ropes.

Distances are sampled on grids of ``N_COLUMNS`` columns, evenly spaced along the band, by
``N_ROWS`` rows from the band towards where the rope may be, and a little farther::

       A o==+===+===+===+==o B    the band
         .  |   |   |   |  .
          . |   |   |   | .       the rope: a parabola of its length, or a PBD rope
            `   +   +   '
"""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.band.row_kernels import fill_points_along, length_of_band
from systems.rope.features.parabola_kernels import LEAST_WIDTH, parabola_bend
from systems.rope.obstacles.signed_distance_kernels import distance
from systems.rope.rope_length import length_between

N_COLUMNS = 16
N_ROWS = 8
# The lowest row is farther from the band than the rope is, by this factor.
DEPTH = 1.2
# Distances are clipped to these limits, beyond which they do not matter to a rope, in metres; they
# are given in units.
NEAREST, FARTHEST, UNIT = -0.05, 0.15, 0.05
# Grippers nearer to one another than this, in metres and seen from above, give no direction.
LEAST_SPAN = 1e-6


@compiled
def clipped_distance(x: float, y: float, z: float, packed: Any) -> float:
    """Distance to the obstacles, clipped, in units."""
    return min(FARTHEST, max(NEAREST, distance(x, y, z, packed))) / UNIT


@compiled
def hanging_parabola(band: Any, span: float, rope_length: float) -> tuple[float, float]:
    """Return the width and the bend of the parabola in which the rope would hang.

    ``span`` is the length of the band seen from above. The parabola is that of a rope that hangs
    freely after the band was straightened in a vertical plane.
    """
    width, rise = max(span, LEAST_WIDTH), band[5] - band[2]
    if rope_length * rope_length > width * width + rise * rise:
        return width, parabola_bend(width, rise, rope_length)
    return width, 0.0


@compiled
def hanging_depths(bands: Any, rope_length: float) -> Any:
    """Return how deep below each band the rope would hang, metres, shape (n,)."""
    depths = np.empty(bands.shape[0])
    for i in range(bands.shape[0]):
        width, bend = hanging_parabola(bands[i], length_of_band(bands[i], True), rope_length)
        depths[i] = 0.25 * bend * width * width
    return depths


@compiled
def fill_hanging_clearance(
    band: Any, packed: Any, rope_length: float, points: Any, clearances: Any
) -> float:
    """Write distances on a grid straight below a band; return how deep the rope hangs.

    Columns are evenly spaced along the band seen from above, and start at ``points``, which are
    written too.
    """
    span = length_of_band(band, True)
    width, bend = hanging_parabola(band, span, rope_length)
    fill_points_along(band, 0.5, span / N_COLUMNS, True, points)
    for column in range(N_COLUMNS):
        at = (column + 0.5) / N_COLUMNS
        x, y, z = points[column, 0], points[column, 1], points[column, 2]
        sag = bend * width * width * at * (1.0 - at)
        for row in range(N_ROWS):
            down = DEPTH * sag * (row + 1) / N_ROWS
            clearances[column, row] = clipped_distance(x, y, z - down, packed)
    return 0.25 * bend * width * width


@compiled
def hanging_clearances(bands: Any, packed: Any, rope_length: float) -> tuple[Any, Any]:
    """Return distances to the obstacles between each band and the rope that hangs below it.

    Parameters
    ----------
    bands : ndarray of shape (n, reduced_dim)
    packed : ndarray of shape (n_rows, 8)
    rope_length : float
        At rest, metres.

    Returns
    -------
    clearances : ndarray of shape (n, N_COLUMNS, N_ROWS)
        Clipped, in units of 0.05 m.
    depths : ndarray of shape (n,)
        How deep the rope hangs, metres.
    """
    n = bands.shape[0]
    clearances, depths, points = (
        np.empty((n, N_COLUMNS, N_ROWS)),
        np.empty(n),
        np.empty((N_COLUMNS, 3)),
    )
    for i in range(n):
        depths[i] = fill_hanging_clearance(bands[i], packed, rope_length, points, clearances[i])
    return clearances, depths


@compiled
def direction(band: Any) -> tuple[float, float]:
    """Return the horizontal direction from gripper A to gripper B."""
    x, y = band[3] - band[0], band[4] - band[1]
    length = np.sqrt(x * x + y * y)
    if length > LEAST_SPAN:
        return x / length, y / length
    return 1.0, 0.0


@compiled
def fill_pbd_clearance(
    band: Any, nodes: Any, packed: Any, points: Any, clearances: Any, offsets: Any
) -> None:
    """Write distances on a grid from a band to a PBD rope, and the ways from one to the other.

    Columns run from points of the band to the points of the PBD rope at the same shares of their
    lengths. Offsets are along the direction from A to B, to the left of it, and up.
    """
    last = nodes.shape[0] - 1
    along_x, along_y = direction(band)
    for column in range(N_COLUMNS):
        at = (column + 0.5) / N_COLUMNS
        px, py, pz = points[column, 0], points[column, 1], points[column, 2]
        node = min(last - 1, int(at * last))
        share = at * last - node
        x = nodes[node, 0] + share * (nodes[node + 1, 0] - nodes[node, 0]) - px
        y = nodes[node, 1] + share * (nodes[node + 1, 1] - nodes[node, 1]) - py
        z = nodes[node, 2] + share * (nodes[node + 1, 2] - nodes[node, 2]) - pz
        offsets[column, 0] = (x * along_x + y * along_y) / UNIT
        offsets[column, 1] = (y * along_x - x * along_y) / UNIT
        offsets[column, 2] = z / UNIT
        for row in range(N_ROWS):
            away = DEPTH * (row + 1) / N_ROWS
            clearances[column, row] = clipped_distance(
                px + away * x, py + away * y, pz + away * z, packed
            )


@compiled
def pbd_clearances(bands: Any, ropes: Any, n_nodes: int, packed: Any) -> tuple[Any, Any, Any]:
    """Return distances to the obstacles between bands and PBD ropes, and where the latter are.

    Parameters
    ----------
    bands : ndarray of shape (n, reduced_dim)
    ropes : ndarray of shape (n, n_ropes, 6 * (n_nodes - 2))
    n_nodes : int
        Nodes of each rope, with both ends.
    packed : ndarray of shape (n_rows, 8)

    Returns
    -------
    clearances : ndarray of shape (n, n_ropes, N_COLUMNS, N_ROWS)
        Clipped, in units of 0.05 m.
    offsets : ndarray of shape (n, n_ropes, N_COLUMNS, 3)
        From band to PBD rope, in units of 0.05 m: along the direction from A to B, to the left of
        it, and up.
    lengths : ndarray of shape (n, n_ropes)
        Of the PBD ropes, metres.
    """
    n, n_ropes = ropes.shape[:2]
    clearances, offsets = (
        np.empty((n, n_ropes, N_COLUMNS, N_ROWS)),
        np.empty((n, n_ropes, N_COLUMNS, 3)),
    )
    lengths, nodes, points = (
        np.empty((n, n_ropes)),
        np.empty((n_nodes, 3)),
        np.empty((N_COLUMNS, 3)),
    )
    for i in range(n):
        band = bands[i]
        nodes[0], nodes[-1] = band[:3], band[3:6]
        fill_points_along(band, 0.5, length_of_band(band, False) / N_COLUMNS, False, points)
        for r in range(n_ropes):
            nodes[1:-1] = ropes[i, r, : 3 * (n_nodes - 2)].reshape(-1, 3)
            fill_pbd_clearance(band, nodes, packed, points, clearances[i, r], offsets[i, r])
            lengths[i, r] = length_between(nodes[:: n_nodes - 1], nodes[1:-1])
    return clearances, offsets, lengths
