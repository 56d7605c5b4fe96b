"""Compiled features of the rope: what lies between the grippers and a rope hanging there."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.obstacles.signed_distance_kernels import distance

CELL = 0.0125
# Narrower than this, the hanging rope's two halves would share their cells.
LEAST_WIDTH = 2 * CELL

_OUTSIDE, _OCCUPIED, _FREE, _SEEN = 0, 1, 2, 3
_BISECTIONS = 60


@compiled
def parabola_length(bend: float, width: float, rise: float) -> float:
    """Arc length of rise/width * s - bend * s * (width - s), for s from 0 to ``width``."""
    start, end = rise / width - bend * width, rise / width + bend * width
    if bend * width < 1e-9:
        return np.sqrt(width * width + rise * rise)
    at_start = start * np.sqrt(1.0 + start * start) + np.arcsinh(start)
    at_end = end * np.sqrt(1.0 + end * end) + np.arcsinh(end)
    return (at_end - at_start) / (4.0 * bend)


@compiled
def parabola_bend(width: float, rise: float, length: float) -> float:
    """Bend of the parabola whose arc has a length; 0 where even the chord is longer."""
    low, high = 0.0, 4.0 * (length + abs(rise)) / (width * width)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if parabola_length(middle, width, rise) < length:
            low = middle
        else:
            high = middle
    return low


@compiled
def fill_slice(row: Any, packed: Any, length: float, cells: Any) -> tuple[int, int]:
    """Mark the cells of the vertical slice between chord and parabola as free or occupied.

    Cells beyond them, and a frame of one cell around, are occupied. Returns the numbers of
    columns and rows.
    """
    ux, uy = row[3] - row[0], row[4] - row[1]
    apart = np.sqrt(ux * ux + uy * uy)
    if apart > 1e-9:
        ux, uy = ux / apart, uy / apart
    else:
        ux, uy = 1.0, 0.0
    width, rise = max(apart, LEAST_WIDTH), row[5] - row[2]
    bend = parabola_bend(width, rise, length)
    low, high = min(0.0, rise), max(0.0, rise)
    if bend > 0.0:
        lowest = min(width, max(0.0, 0.5 * (width - rise / (bend * width))))
        low = min(low, lowest * (rise / width - bend * (width - lowest)))
    n, m = int(np.ceil(width / CELL)) + 2, int(np.ceil((high - low) / CELL)) + 2
    n, m = min(n, cells.shape[0]), min(m, cells.shape[1])
    for i in range(n):
        s = (i - 0.5) * CELL
        chord = rise / width * s
        curve = chord - bend * s * (width - s)
        x, y, kind, alike = row[0] + s * ux, row[1] + s * uy, _FREE, 0
        for j in range(m):
            z = low + (j - 0.5) * CELL
            cells[i, j] = _OCCUPIED
            if 0 < i < n - 1 and 0 < j < m - 1 and s < width and curve <= z <= chord:
                if alike == 0:
                    d = distance(x, y, row[2] + z, packed)
                    kind = _FREE if d > 0.0 else _OCCUPIED
                    # No cell that is nearer than the surface is of the other kind.
                    alike = 1 + max(0, int(abs(d) / CELL - 1e-6))
                cells[i, j] = kind
                alike -= 1
    return n, m


@compiled
def count_components(cells: Any, n: int, m: int, stack: Any) -> tuple[int, int]:
    """Count the connected parts that are free and occupied, and mark their cells as seen."""
    n_free, n_occupied = 0, 0
    for i in range(n):
        for j in range(m):
            kind = cells[i, j]
            if kind == _SEEN:
                continue
            n_free += kind == _FREE
            n_occupied += kind == _OCCUPIED
            cells[i, j], stack[0], size = _SEEN, i * m + j, 1
            while size:
                size -= 1
                x, y = stack[size] // m, stack[size] % m
                for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                    u, v = x + dx, y + dy
                    if 0 <= u < n and 0 <= v < m and cells[u, v] == kind:
                        cells[u, v] = _SEEN
                        stack[size] = u * m + v
                        size += 1
    return n_free, n_occupied


@compiled
def fill_components(
    rows: Any, packed: Any, length: float, cells: Any, stack: Any, out: Any
) -> None:
    """Write the numbers of free and occupied parts of each row's slice."""
    for i in range(rows.shape[0]):
        n, m = fill_slice(rows[i], packed, length, cells)
        out[i, 0], out[i, 1] = count_components(cells, n, m, stack)
