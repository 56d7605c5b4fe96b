"""Compiled voxel grids of rope transitions: the surroundings, and the band before and after.

A grid has SIDE cells along each axis. While the surroundings are filled in, a column of cells along
z is one number of SIDE bits, of which the highest is the lowest cell.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.band.row_kernels import resample_row
from systems.rope.obstacles.packing import (
    AXIS,
    BOX,
    CAPSULE,
    CORE_X,
    CORE_Y,
    CORE_Z,
    CYLINDER,
    HALF_LENGTH,
    HALF_X,
    HALF_Y,
    HALF_Z,
    KIND,
    RADIUS,
    X,
    Y,
    Z,
)
from systems.rope.obstacles.round_kernels import capsule_distance
from systems.rope.obstacles.signed_distance_kernels import (
    EMPTY,
    radius_around,
    row_after,
    seldom_distance,
)

SIDE = 32

# The lowest cell of a column, no cell, and all of them.
_TOP = np.uint32(1 << (SIDE - 1))
_NONE, _ALL = np.uint32(0), np.uint32(0xFFFFFFFF)


@compiled(inline="always")
def cells_from(k: int) -> np.uint32:
    """Mark the cells of a column from the k-th lowest on, counted from 0."""
    return _ALL if k <= 0 else np.uint32((np.uint64(1) << np.uint64(SIDE - k)) - np.uint64(1))


@compiled
def index_range(centers: Any, middle: float, half: float) -> tuple[int, int]:
    """Return the first index whose centre is within ``half`` of ``middle``, and the end."""
    first, end = 0, centers.shape[0]
    while first < end and abs(centers[first] - middle) - half > 0.0:
        first += 1
    while end > first and abs(centers[end - 1] - middle) - half > 0.0:
        end -= 1
    return first, end


@compiled(inline="always")
def column(first: int, end: int) -> np.uint32:
    """Mark the cells of a column from ``first`` up to ``end``."""
    return cells_from(first) & ~cells_from(end)


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
    i0, i1 = index_range(centers[0], row[X], row[HALF_X])
    j0, j1 = index_range(centers[1], row[Y], row[HALF_Y])
    k0, k1 = index_range(centers[2], row[Z], row[HALF_Z])
    mark = column(k0, k1)
    if mark != _NONE:
        for i in range(i0, i1):
            for j in range(j0, j1):
                columns[i, j] |= mark


@compiled
def add_cylinder(centers: Any, row: Any, columns: Any) -> None:
    """Occupy the cells whose centres lie in a cylinder along an axis."""
    axis, radius = int(row[AXIS]), row[RADIUS]
    i0, i1 = index_range(centers[0], row[X], row[HALF_LENGTH] if axis == 0 else radius)
    j0, j1 = index_range(centers[1], row[Y], row[HALF_LENGTH] if axis == 1 else radius)
    k0, k1 = index_range(centers[2], row[Z], row[HALF_LENGTH] if axis == 2 else radius)
    for i in range(i0, i1):
        u = 0.0 if axis == 0 else centers[0, i] - row[X]
        for j in range(j0, j1):
            v = 0.0 if axis == 1 else centers[1, j] - row[Y]
            for k in range(k0, k1):
                w = 0.0 if axis == 2 else centers[2, k] - row[Z]
                if np.sqrt(u * u + v * v + w * w) - radius <= 0.0:
                    columns[i, j] |= _TOP >> np.uint32(k)


@compiled
def add_capsule(centers: Any, row: Any, columns: Any) -> None:
    """Occupy the cells whose centres lie in a capsule."""
    reach = row[RADIUS] * (1.0 + 1e-9)  # Rounding must not lose the cells at its ends.
    i0, i1 = index_range(centers[0], row[X] + 0.5 * row[CORE_X], 0.5 * abs(row[CORE_X]) + reach)
    j0, j1 = index_range(centers[1], row[Y] + 0.5 * row[CORE_Y], 0.5 * abs(row[CORE_Y]) + reach)
    k0, k1 = index_range(centers[2], row[Z] + 0.5 * row[CORE_Z], 0.5 * abs(row[CORE_Z]) + reach)
    for i in range(i0, i1):
        for j in range(j0, j1):
            for k in range(k0, k1):
                x, y, z = centers[0, i], centers[1, j], centers[2, k]
                if capsule_distance(x, y, z, row, EMPTY) <= 0.0:
                    columns[i, j] |= _TOP >> np.uint32(k)


@compiled
def add_seldom(centers: Any, packed: Any, index: int, columns: Any) -> None:
    """Occupy the cells whose centres lie in an obstacle of a kind that few scenes have."""
    row = packed[index]
    reach = radius_around(row) * (1.0 + 1e-9)  # Rounding must not lose the cells at its ends.
    i0, i1 = index_range(centers[0], row[X], reach)
    j0, j1 = index_range(centers[1], row[Y], reach)
    k0, k1 = index_range(centers[2], row[Z], reach)
    for i in range(i0, i1):
        for j in range(j0, j1):
            for k in range(k0, k1):
                x, y, z = centers[0, i], centers[1, j], centers[2, k]
                if seldom_distance(x, y, z, packed, index, EMPTY) <= 0.0:
                    columns[i, j] |= _TOP >> np.uint32(k)


@compiled
def fill_surroundings(centers: Any, bounds: Any, packed: Any, columns: Any) -> None:
    """Occupy the cells whose centres are not in free space."""
    fill_outside(centers, bounds, columns)
    index = 0
    while index < packed.shape[0]:
        row = packed[index]
        if row[KIND] == BOX:
            add_box(centers, row, columns)
        elif row[KIND] == CYLINDER:
            add_cylinder(centers, row, columns)
        elif row[KIND] == CAPSULE:
            add_capsule(centers, row, columns)
        else:
            add_seldom(centers, packed, index, columns)
        index = row_after(packed, index)


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
def voxel_rows(
    bands: Any, next_bands: Any, packed: Any, bounds: Any, side: float, n_points: int
) -> Any:
    """Return each transition's three grids as packed bits.

    Parameters
    ----------
    bands, next_bands : ndarray of shape (n, reduced_dim)
    packed : ndarray of shape (n_rows, 8)
    bounds : ndarray of shape (2, 3)
        Of the world, metres.
    side : float
        Of the grid, metres.
    n_points : int
        Points along a band whose cells are occupied.

    Returns
    -------
    rows : ndarray of uint8 of shape (n, 3 * SIDE**3 / 8)
    """
    size = SIDE * SIDE * SIDE // 8
    rows = np.zeros((bands.shape[0], 3 * size), np.uint8)
    cell, per_metre = side / SIDE, SIDE / side
    origin, centers = np.empty(3), np.empty((3, SIDE))
    columns, points = np.empty((SIDE, SIDE), np.uint32), np.empty((n_points, 3))
    for index in range(bands.shape[0]):
        band, following = bands[index], next_bands[index]
        for axis in range(3):
            before, after = band[axis] + band[3 + axis], following[axis] + following[3 + axis]
            origin[axis] = 0.25 * (before + after) - 0.5 * side
            for k in range(SIDE):
                centers[axis, k] = origin[axis] + (k + 0.5) * cell
        fill_surroundings(centers, bounds, packed, columns)
        write_columns(columns, rows[index, :size])
        resample_row(band, points)
        add_points(points, origin, per_metre, rows[index, size : 2 * size])
        resample_row(following, points)
        add_points(points, origin, per_metre, rows[index, 2 * size :])
    return rows
