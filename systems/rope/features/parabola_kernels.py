"""Compiled parabola that stands for a rope hanging freely between its grippers.

It is the curve rise / width * s - bend * s * (width - s), for s from 0 to ``width``: the straight
line between the ends, less a sag that grows with ``bend``.
"""

from __future__ import annotations

import numpy as np

from systems.compilation import compiled

# Metres: a side of the cells that the region below the rope is divided into, where it is counted.
CELL = 0.0125
# The least width of a hanging rope: in less, its two halves would share their cells.
LEAST_WIDTH = 2 * CELL

_BISECTIONS = 60


@compiled
def parabola_length(bend: float, width: float, rise: float) -> float:
    """Arc length of the parabola."""
    start, end = rise / width - bend * width, rise / width + bend * width
    if bend * width < 1e-9:
        return np.sqrt(width * width + rise * rise)
    at_start = start * np.sqrt(1.0 + start * start) + np.arcsinh(start)
    at_end = end * np.sqrt(1.0 + end * end) + np.arcsinh(end)
    return (at_end - at_start) / (4.0 * bend)


@compiled
def parabola_bend(width: float, rise: float, length: float) -> float:
    """Bend of the parabola whose arc has a length; 0 where even the straight line is longer."""
    low, high = 0.0, 4.0 * (length + abs(rise)) / (width * width)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if parabola_length(middle, width, rise) < length:
            low = middle
        else:
            high = middle
    return low
