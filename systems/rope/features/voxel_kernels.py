"""Compiled voxel grids of rope transitions: the surroundings, and the band before and after."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.band.comparison_kernels import resample_row
from systems.rope.obstacles.signed_distance_kernels import EMPTY, capsule_distance

SIDE = 32

# A column of cells along z is one number; the lowest cell is its highest bit.
_TOP = np.uint32(1 << (SIDE - 1))
_NONE, _ALL = np.uint32(0), np.uint32(0xFFFFFFFF)


@compiled(inline="always")
def cells_below(k: int) -> np.uint32:
    """Mark the lowest k cells of a column."""
    return _ALL if k <= 0 else np.uint32((np.uint64(1) << np.uint64(SIDE - k)) - np.uint64(1))


@compiled
def index_range(centers: Any, middle: float, half: float) -> tuple[int, int]:
    """First index whose centre is within ``half`` of ``middle``, and the one after the last."""
    first, end = 0, centers.shape[0]
    while first < end and abs(centers[first] - middle) - half > 0.0:
        first += 1
    while end > first and abs(centers[end - 1] - middle) - half > 0.0:
        end -= 1
    return first, end


@compiled(inline="always")
def column(first: int, end: int) -> np.uint32:
    """Mark the cells of a column from ``first`` up to ``end``."""
    return cells_below(first) & ~(cells_below(end) if end > 0 else _ALL)


@compiled
def fill_outside(centers: Any, bounds: Any, columns: Any) -> None:
    """Occupy all that lies outside the world; free the rest."""
    sky = _NONE
    for k in range(SIDE):
        if centers[2, k] < bounds[0, 2] or centers[2, k] > bounds[1, 2]:
            sky |= _TOP >> np.uint32(k)
    for i in range(SIDE):
        beyond = centers[0, i] < bounds[0, 0] or centers[0, i] > bounds[1, 0]
        for j in range(SIDE):
            out = beyond or centers[1, j] < bounds[0, 1] or centers[1, j] > bounds[1, 1]
            columns[i, j] = _ALL if out else sky


@compiled
def add_box(centers: Any, row: Any, columns: Any) -> None:
    """Occupy the cells whose centres lie in a box."""
    i0, i1 = index_range(centers[0], row[1], row[4])
    j0, j1 = index_range(centers[1], row[2], row[5])
    k0, k1 = index_range(centers[2], row[3], row[6])
    mark = column(k0, k1)
    if mark != _NONE:
        for i in range(i0, i1):
            for j in range(j0, j1):
                columns[i, j] |= mark


@compiled
def add_cylinder(centers: Any, row: Any, columns: Any) -> None:
    """Occupy the cells whose centres lie in a cylinder along an axis."""
    axis, radius = int(row[4]), row[7]
    i0, i1 = index_range(centers[0], row[1], row[5] if axis == 0 else radius)
    j0, j1 = index_range(centers[1], row[2], row[5] if axis == 1 else radius)
    k0, k1 = index_range(centers[2], row[3], row[5] if axis == 2 else radius)
    for i in range(i0, i1):
        u = 0.0 if axis == 0 else centers[0, i] - row[1]
        for j in range(j0, j1):
            v = 0.0 if axis == 1 else centers[1, j] - row[2]
            for k in range(k0, k1):
                w = 0.0 if axis == 2 else centers[2, k] - row[3]
                if np.sqrt(u * u + v * v + w * w) - radius <= 0.0:
                    columns[i, j] |= _TOP >> np.uint32(k)


@compiled
def add_capsule(centers: Any, row: Any, columns: Any) -> None:
    """Occupy the cells whose centres lie in a capsule."""
    reach = row[7] * (1.0 + 1e-9)  # Rounding must not lose the cells at its ends.
    i0, i1 = index_range(centers[0], row[1] + 0.5 * row[4], 0.5 * abs(row[4]) + reach)
    j0, j1 = index_range(centers[1], row[2] + 0.5 * row[5], 0.5 * abs(row[5]) + reach)
    k0, k1 = index_range(centers[2], row[3] + 0.5 * row[6], 0.5 * abs(row[6]) + reach)
    for i in range(i0, i1):
        for j in range(j0, j1):
            for k in range(k0, k1):
                x, y, z = centers[0, i], centers[1, j], centers[2, k]
                if capsule_distance(x, y, z, row, EMPTY) <= 0.0:
                    columns[i, j] |= _TOP >> np.uint32(k)


@compiled
def fill_surroundings(centers: Any, bounds: Any, packed: Any, columns: Any) -> None:
    """Occupy the cells whose centres are not in free space."""
    fill_outside(centers, bounds, columns)
    for index in range(packed.shape[0]):
        row = packed[index]
        if row[0] == 0.0:
            add_box(centers, row, columns)
        elif row[0] == 1.0:
            add_cylinder(centers, row, columns)
        else:
            add_capsule(centers, row, columns)


@compiled
def add_points(points: Any, origin: Any, per_metre: float, cells: Any) -> None:
    """Occupy the cells that points are in; points beyond the grid are left out."""
    for index in range(points.shape[0]):
        x = np.floor((points[index, 0] - origin[0]) * per_metre)
        y = np.floor((points[index, 1] - origin[1]) * per_metre)
        z = np.floor((points[index, 2] - origin[2]) * per_metre)
        if 0 <= x < SIDE and 0 <= y < SIDE and 0 <= z < SIDE:
            k = int(z)
            cells[((int(x) * SIDE + int(y)) * SIDE + k) >> 3] |= np.uint8(128 >> (k & 7))


@compiled
def write_columns(columns: Any, cells: Any) -> None:
    """Write columns as bytes, the lowest cells first."""
    at = 0
    for i in range(SIDE):
        for j in range(SIDE):
            mark = columns[i, j]
            cells[at] = mark >> np.uint32(24)
            cells[at + 1] = (mark >> np.uint32(16)) & np.uint32(255)
            cells[at + 2] = (mark >> np.uint32(8)) & np.uint32(255)
            cells[at + 3] = mark & np.uint32(255)
            at += 4


@compiled
def fill_voxels(
    rows: Any,
    next_rows: Any,
    packed: Any,
    bounds: Any,
    side: float,
    n_points: int,
    out: Any,
) -> None:
    """Write each transition's three grids, bit by bit, to a row of ``out``, which holds zeros."""
    cell, per_metre = side / SIDE, SIDE / side
    origin, centers = np.empty(3), np.empty((3, SIDE))
    columns, points = np.empty((SIDE, SIDE), np.uint32), np.empty((n_points, 3))
    size = SIDE * SIDE * SIDE // 8
    for index in range(rows.shape[0]):
        row, following = rows[index], next_rows[index]
        for axis in range(3):
            before, after = row[axis] + row[3 + axis], following[axis] + following[3 + axis]
            origin[axis] = 0.25 * (before + after) - 0.5 * side
            for k in range(SIDE):
                centers[axis, k] = origin[axis] + (k + 0.5) * cell
        fill_surroundings(centers, bounds, packed, columns)
        write_columns(columns, out[index, :size])
        resample_row(row, points)
        add_points(points, origin, per_metre, out[index, size : 2 * size])
        resample_row(following, points)
        add_points(points, origin, per_metre, out[index, 2 * size :])
