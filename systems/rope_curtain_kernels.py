"""Compiled features of the rope: how near obstacles are to what hangs below the band."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from systems.band_kernels import n_points
from systems.distance_kernels import distance
from systems.loose_rope_kernels import nodes_length, read_nodes
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
def clipped_distance(x: float, y: float, z: float, packed: Any) -> float:
    """Distance to the obstacles in units, where it matters."""
    return min(FARTHEST, max(NEAREST, distance(x, y, z, packed))) / UNIT


@njit(cache=True, nogil=True)
def hanging(row: Any, shadow: float, rope_length: float) -> tuple[float, float]:
    """Return the width and the bend of the parabola that the rope would hang in."""
    width, rise = max(shadow, LEAST_WIDTH), row[5] - row[2]
    if rope_length * rope_length > width * width + rise * rise:
        return width, parabola_bend(width, rise, rope_length)
    return width, 0.0


@njit(cache=True, nogil=True)
def fill_depths(rows: Any, rope_length: float, depths: Any) -> None:
    """Write how deep the rope of each row hangs."""
    for i in range(rows.shape[0]):
        shadow = horizontal_length(rows[i], n_points(rows[i]))
        width, bend = hanging(rows[i], shadow, rope_length)
        depths[i] = 0.25 * bend * width * width


@njit(cache=True, nogil=True)
def fill_curtain(row: Any, packed: Any, rope_length: float, out: Any) -> float:
    """Write distances on a grid that hangs from a band; return how deep the rope hangs.

    Columns are evenly spaced along the band's shadow. The rope hangs by the parabola that it
    would hang in if the band were straightened in a vertical plane.
    """
    n = n_points(row)
    shadow = horizontal_length(row, n)
    width, bend = hanging(row, shadow, rope_length)
    i, travelled, segment = 0, 0.0, shadow_length(row, 0)
    for column in range(N_COLUMNS):
        at = (column + 0.5) / N_COLUMNS
        while i < n - 2 and travelled + segment < at * shadow:
            travelled += segment
            i += 1
            segment = shadow_length(row, i)
        ratio = (at * shadow - travelled) / segment if segment > 1e-12 else at
        px, py, pz = on_segment(row, i, ratio)
        sag = bend * width * width * at * (1.0 - at)
        for j in range(N_ROWS):
            down = DEPTH * sag * (j + 1) / N_ROWS
            out[column, j] = clipped_distance(px, py, pz - down, packed)
    return 0.25 * bend * width * width


@njit(cache=True, nogil=True)
def on_segment(row: Any, i: int, ratio: float) -> tuple[float, float, float]:
    """Return a point of a band, on the segment from its point ``i``."""
    ratio, first = min(1.0, max(0.0, ratio)), 6 + 3 * i
    return (
        row[first] + ratio * (row[first + 3] - row[first]),
        row[first + 1] + ratio * (row[first + 4] - row[first + 1]),
        row[first + 2] + ratio * (row[first + 5] - row[first + 2]),
    )


@njit(cache=True, nogil=True)
def direction(row: Any) -> tuple[float, float]:
    """Return the horizontal direction from gripper A to gripper B."""
    x, y = row[3] - row[0], row[4] - row[1]
    length = np.sqrt(x * x + y * y)
    if length > LEAST_SPAN:
        return x / length, y / length
    return 1.0, 0.0


@njit(cache=True, nogil=True)
def segment_length(row: Any, i: int) -> float:
    """Length of a band's segment from point ``i``."""
    rise = row[11 + 3 * i] - row[8 + 3 * i]
    return np.sqrt(shadow_length(row, i) ** 2 + rise * rise)


@njit(cache=True, nogil=True)
def fill_sheet(row: Any, nodes: Any, packed: Any, sheet: Any, offsets: Any) -> None:
    """Write distances on a grid from a band to a loose rope, and the way from one to the other.

    Columns match points at the same shares of the lengths. Offsets are along the way from A to
    B, to the left of it, and up.
    """
    n, last, length = n_points(row), nodes.shape[0] - 1, 0.0
    for i in range(n - 1):
        length += segment_length(row, i)
    along_x, along_y = direction(row)
    i, travelled, segment = 0, 0.0, segment_length(row, 0)
    for column in range(N_COLUMNS):
        at = (column + 0.5) / N_COLUMNS
        while i < n - 2 and travelled + segment < at * length:
            travelled += segment
            i += 1
            segment = segment_length(row, i)
        ratio = (at * length - travelled) / segment if segment > 1e-12 else at
        px, py, pz = on_segment(row, i, ratio)
        node = min(last - 1, int(at * last))
        share = at * last - node
        x = nodes[node, 0] + share * (nodes[node + 1, 0] - nodes[node, 0]) - px
        y = nodes[node, 1] + share * (nodes[node + 1, 1] - nodes[node, 1]) - py
        z = nodes[node, 2] + share * (nodes[node + 1, 2] - nodes[node, 2]) - pz
        offsets[column, 0] = (x * along_x + y * along_y) / UNIT
        offsets[column, 1] = (y * along_x - x * along_y) / UNIT
        offsets[column, 2] = z / UNIT
        for j in range(N_ROWS):
            away = DEPTH * (j + 1) / N_ROWS
            sheet[column, j] = clipped_distance(px + away * x, py + away * y, pz + away * z, packed)


@njit(cache=True, nogil=True)
def fill_curtains(rows: Any, packed: Any, rope_length: float, out: Any, depths: Any) -> None:
    """Write the curtain of each row, and how deep its rope hangs."""
    for i in range(rows.shape[0]):
        depths[i] = fill_curtain(rows[i], packed, rope_length, out[i])


@njit(cache=True, nogil=True)
def fill_sheets(
    bands: Any, ropes: Any, n_nodes: int, packed: Any, sheets: Any, offsets: Any, lengths: Any
) -> None:
    """Write what :func:`fill_sheet` does of each row, and the lengths of the loose ropes."""
    nodes, moved = np.empty((n_nodes, 3)), np.empty((n_nodes, 3))
    for i in range(bands.shape[0]):
        read_nodes(ropes[i], bands[i], nodes, moved)
        fill_sheet(bands[i], nodes, packed, sheets[i], offsets[i])
        lengths[i] = nodes_length(nodes)
