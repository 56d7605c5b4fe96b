"""Compiled features of the rope: how near obstacles are to what hangs below the band."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from systems.band_kernels import n_points
from systems.distance_kernels import distance
from systems.rope_feature_kernels import LEAST_WIDTH, parabola_bend

N_COLUMNS = 16
N_ROWS = 8
# The lowest row is deeper than the rope hangs by this factor.
DEPTH = 1.2
# Distances beyond these, in metres, are all the same to a rope.
NEAREST, FARTHEST, UNIT = -0.05, 0.15, 0.05
# Grippers that are nearer, in metres and seen from above, give no direction.
LEAST_SPAN = 1e-6


@njit(cache=True, nogil=True)
def shadow_length(row: Any, i: int) -> float:
    """Length of the shadow that a band's segment from point ``i`` casts on the floor."""
    x, y = row[9 + 3 * i] - row[6 + 3 * i], row[10 + 3 * i] - row[7 + 3 * i]
    return np.sqrt(x * x + y * y)


@njit(cache=True, nogil=True)
def horizontal_length(row: Any, n: int) -> float:
    """Length of the shadow that a band casts on the floor."""
    total = 0.0
    for i in range(n - 1):
        total += shadow_length(row, i)
    return total


@njit(cache=True, nogil=True)
def fill_curtain(row: Any, tilts: Any, packed: Any, rope_length: float, out: Any) -> float:
    """Write clipped distances on grids that hang from a band; return how deep the rope hangs.

    A grid may be tilted to the left of the way from A to B, as a rope that drags behind hangs.
    Columns are evenly spaced along the band's shadow. The rope hangs by the parabola that it
    would hang in if the band were straightened in a vertical plane.
    """
    n = n_points(row)
    shadow = horizontal_length(row, n)
    width, rise = max(shadow, LEAST_WIDTH), row[5] - row[2]
    bend = 0.0
    if rope_length * rope_length > width * width + rise * rise:
        bend = parabola_bend(width, rise, rope_length)
    left_x, left_y = _leftwards(row)
    i, travelled, segment = 0, 0.0, shadow_length(row, 0)
    for column in range(N_COLUMNS):
        at = (column + 0.5) / N_COLUMNS
        while i < n - 2 and travelled + segment < at * shadow:
            travelled += segment
            i += 1
            segment = shadow_length(row, i)
        ratio = (at * shadow - travelled) / segment if segment > 1e-12 else at
        ratio = min(1.0, max(0.0, ratio))
        px = row[6 + 3 * i] + ratio * (row[9 + 3 * i] - row[6 + 3 * i])
        py = row[7 + 3 * i] + ratio * (row[10 + 3 * i] - row[7 + 3 * i])
        pz = row[8 + 3 * i] + ratio * (row[11 + 3 * i] - row[8 + 3 * i])
        sag = bend * width * width * at * (1.0 - at)
        for k in range(tilts.shape[0]):
            aside, down = np.sin(tilts[k]), np.cos(tilts[k])
            for j in range(N_ROWS):
                away = DEPTH * sag * (j + 1) / N_ROWS
                x, y = px + aside * away * left_x, py + aside * away * left_y
                d = distance(x, y, pz - down * away, packed)
                out[k, column, j] = min(FARTHEST, max(NEAREST, d)) / UNIT
    return 0.25 * bend * width * width


@njit(cache=True, nogil=True)
def _leftwards(row: Any) -> Any:
    """Return the horizontal direction to the left of the way from A to B."""
    x, y = row[3] - row[0], row[4] - row[1]
    length = np.sqrt(x * x + y * y)
    if length > LEAST_SPAN:
        return -y / length, x / length
    return 0.0, 1.0


@njit(cache=True, nogil=True)
def fill_curtains(
    rows: Any, tilts: Any, packed: Any, rope_length: float, out: Any, depths: Any
) -> None:
    """Write the curtains of each row, and how deep its rope hangs."""
    for i in range(rows.shape[0]):
        depths[i] = fill_curtain(rows[i], tilts, packed, rope_length, out[i])
