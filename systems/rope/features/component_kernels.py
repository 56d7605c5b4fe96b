"""Compiled count of the connected parts of the vertical region in which the rope may hang."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.features.parabola_kernels import CELL, LEAST_WIDTH, parabola_bend
from systems.rope.obstacles.signed_distance_kernels import distance

_OCCUPIED, _FREE, _SEEN = 1, 2, 3
# Grippers nearer to one another than this, in metres and seen from above, give no direction.
_LEAST_SPAN = 1e-9


@compiled
def fill_region(row: Any, packed: Any, length: float, cells: Any) -> tuple[int, int]:
    """Mark the cells between the straight line and the hanging parabola as free or occupied.

    The cells lie in the vertical plane through the grippers. Those above the line or below the
    parabola, and a frame one cell wide around, are occupied. Returns the numbers of columns and
    rows.
    """
    ux, uy = row[3] - row[0], row[4] - row[1]
    apart = np.sqrt(ux * ux + uy * uy)
    if apart > _LEAST_SPAN:
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
                    # Cells that are nearer than the surface are of the same kind.
                    alike = 1 + max(0, int(abs(d) / CELL - 1e-6))
                cells[i, j] = kind
                alike -= 1
    return n, m


@compiled
def count_components(cells: Any, n: int, m: int, stack: Any) -> tuple[int, int]:
    """Count the connected free and occupied parts, marking their cells as seen."""
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
def component_counts(bands: Any, packed: Any, length: float, side: int) -> Any:
    """Count the free and the occupied parts below each band's grippers.

    Parameters
    ----------
    bands : ndarray of shape (n, reduced_dim)
    packed : ndarray of shape (n_rows, 8)
    length : float
        Of the rope that hangs between the grippers, metres.
    side : int
        Cells along the largest region that there may be, in either direction.

    Returns
    -------
    counts : ndarray of shape (n, 2)
    """
    counts = np.empty((bands.shape[0], 2))
    cells, stack = np.empty((side, side), np.uint8), np.empty(side * side, np.int64)
    for i in range(bands.shape[0]):
        n, m = fill_region(bands[i], packed, length, cells)
        counts[i, 0], counts[i, 1] = count_components(cells, n, m, stack)
    return counts
