"""Colours of what the viewer adds to a system's own, readable for the colour-blind as well."""

from __future__ import annotations

import numpy as np

from systems.drawing.shapes import Color
from systems.system import Array

TREE: Color = (0.62, 0.65, 0.70, 1.0)
EXECUTED: Color = (0.10, 0.11, 0.13, 1.0)
NOT_ESTIMATED: Color = (0.36, 0.55, 0.78, 1.0)
GOAL: Color = (0.82, 0.15, 0.55, 0.9)
LEFT_PLAN: Color = (0.93, 0.20, 0.10, 0.9)
# Red, amber, blue: of a reliability of 0, 0.5 and 1.
_RELIABILITY = np.array([[0.84, 0.10, 0.11], [0.98, 0.68, 0.20], [0.10, 0.40, 0.76]])


def reliability_colors(reliability: Array) -> Array:
    """Return the colour of each reliability, from red for 0 to blue for 1.

    Parameters
    ----------
    reliability : ndarray of shape (n,)

    Returns
    -------
    colors : ndarray of shape (n, 3)
        Red, green and blue, from 0 to 1.
    """
    stops = np.linspace(0, 1, len(_RELIABILITY))
    return np.column_stack(
        [np.interp(reliability, stops, channel) for channel in _RELIABILITY.T]
    ).reshape(-1, 3)


def css(color: Color | Array) -> str:
    """Write a colour, red, green and blue of it, as web pages do."""
    red, green, blue = (round(255 * float(part)) for part in color[:3])
    return f"#{red:02x}{green:02x}{blue:02x}"
