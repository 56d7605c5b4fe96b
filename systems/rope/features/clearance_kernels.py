"""Compiled features of the rope: how near obstacles are to what hangs below the band."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.band.propagation_kernels import n_points
from systems.rope.features.component_kernels import LEAST_WIDTH, parabola_bend
from systems.rope.kernels import length_between
from systems.rope.obstacles.signed_distance_kernels import distance

N_COLUMNS = 16
N_ROWS = 8
# The lowest row is deeper than the rope hangs by this factor.
DEPTH = 1.2
# Distances beyond these, in metres, are all the same to a rope.
NEAREST, FARTHEST, UNIT = -0.05, 0.15, 0.05
# Grippers that are nearer, in metres and seen from above, give no direction.
LEAST_SPAN = 1e-6


@compiled
def segment_length(row: Any, i: int, flat: bool) -> float:
    """Length of a band's segment from point ``i``, or of its shadow on a flat floor."""
    first = 6 + 3 * i
    x, y = row[first + 3] - row[first], row[first + 4] - row[first + 1]
    shadow = np.sqrt(x * x + y * y)
    if flat:
        return shadow
    rise = row[first + 5] - row[first + 2]
    return np.sqrt(shadow**2 + rise * rise)


@compiled
def length_of(row: Any, flat: bool) -> float:
    """Length of a band, or of its shadow."""
    total = 0.0
    for i in range(n_points(row) - 1):
        total += segment_length(row, i, flat)
    return total


@compiled
def fill_band_points(row: Any, length: float, flat: bool, tops: Any) -> None:
    """Write the points of a band that columns hang from: evenly along it, or along its shadow."""
    n = n_points(row)
    i, travelled, segment = 0, 0.0, segment_length(row, 0, flat)
    for column in range(N_COLUMNS):
        at = (column + 0.5) / N_COLUMNS
        while i < n - 2 and travelled + segment < at * length:
            travelled += segment
            i += 1
            segment = segment_length(row, i, flat)
        ratio = (at * length - travelled) / segment if segment > 1e-12 else at
        ratio, first = min(1.0, max(0.0, ratio)), 6 + 3 * i
        for k in range(3):
            tops[column, k] = row[first + k] + ratio * (row[first + 3 + k] - row[first + k])


@compiled
def clipped_distance(x: float, y: float, z: float, packed: Any) -> float:
    """Distance to the obstacles in units, where it matters."""
    return min(FARTHEST, max(NEAREST, distance(x, y, z, packed))) / UNIT


@compiled
def hanging(row: Any, shadow: float, rope_length: float) -> tuple[float, float]:
    """Return the width and the bend of the parabola that the rope would hang in."""
    width, rise = max(shadow, LEAST_WIDTH), row[5] - row[2]
    if rope_length * rope_length > width * width + rise * rise:
        return width, parabola_bend(width, rise, rope_length)
    return width, 0.0


@compiled
def fill_depths(rows: Any, rope_length: float, depths: Any) -> None:
    """Write how deep the rope of each row hangs."""
    for i in range(rows.shape[0]):
        shadow = length_of(rows[i], True)
        width, bend = hanging(rows[i], shadow, rope_length)
        depths[i] = 0.25 * bend * width * width


@compiled
def fill_hanging_clearance(row: Any, packed: Any, rope_length: float, tops: Any, out: Any) -> float:
    """Write distances on a grid that hangs from a band; return how deep the rope hangs.

    Columns are evenly spaced along the band's shadow. The rope hangs by the parabola that it
    would hang in if the band were straightened in a vertical plane.
    """
    shadow = length_of(row, True)
    width, bend = hanging(row, shadow, rope_length)
    fill_band_points(row, shadow, True, tops)
    for column in range(N_COLUMNS):
        at = (column + 0.5) / N_COLUMNS
        px, py, pz = tops[column, 0], tops[column, 1], tops[column, 2]
        sag = bend * width * width * at * (1.0 - at)
        for j in range(N_ROWS):
            down = DEPTH * sag * (j + 1) / N_ROWS
            out[column, j] = clipped_distance(px, py, pz - down, packed)
    return 0.25 * bend * width * width


@compiled
def direction(row: Any) -> tuple[float, float]:
    """Return the horizontal direction from gripper A to gripper B."""
    x, y = row[3] - row[0], row[4] - row[1]
    length = np.sqrt(x * x + y * y)
    if length > LEAST_SPAN:
        return x / length, y / length
    return 1.0, 0.0


@compiled
def fill_slack_clearance(
    row: Any, nodes: Any, packed: Any, tops: Any, sheet: Any, offsets: Any
) -> None:
    """Write distances on a grid from a band to a PBD rope, and the way from one to the other.

    Columns match points at the same shares of the lengths; ``tops`` are the band's. Offsets are
    along the way from A to B, to the left of it, and up.
    """
    last = nodes.shape[0] - 1
    along_x, along_y = direction(row)
    for column in range(N_COLUMNS):
        at = (column + 0.5) / N_COLUMNS
        px, py, pz = tops[column, 0], tops[column, 1], tops[column, 2]
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


@compiled
def fill_hanging_clearances(
    rows: Any, packed: Any, rope_length: float, out: Any, depths: Any
) -> None:
    """Write the curtain of each row, and how deep its rope hangs."""
    tops = np.empty((N_COLUMNS, 3))
    for i in range(rows.shape[0]):
        depths[i] = fill_hanging_clearance(rows[i], packed, rope_length, tops, out[i])


@compiled
def fill_slack_clearances(
    bands: Any, ropes: Any, n_nodes: int, packed: Any, sheets: Any, offsets: Any, lengths: Any
) -> None:
    """Write what :func:`fill_slack_clearance` does of each row's ropes, and their lengths."""
    nodes, tops = np.empty((n_nodes, 3)), np.empty((N_COLUMNS, 3))
    for i in range(bands.shape[0]):
        nodes[0], nodes[-1] = bands[i, :3], bands[i, 3:6]
        fill_band_points(bands[i], length_of(bands[i], False), False, tops)
        for r in range(ropes.shape[1]):
            nodes[1:-1] = ropes[i, r, : 3 * (n_nodes - 2)].reshape(-1, 3)
            fill_slack_clearance(bands[i], nodes, packed, tops, sheets[i, r], offsets[i, r])
            lengths[i, r] = length_between(nodes[:: n_nodes - 1], nodes[1:-1])
