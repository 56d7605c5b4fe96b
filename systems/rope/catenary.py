"""The catenary: the curve in which a rope hangs from gripper to gripper."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from systems.rope.obstacles.shapes import Array
from systems.validation import as_finite_array

# A rope that is less slack than this share of its length is laid straight.
_TAUT = 1e-6
# The least width of a catenary, as a share of its length: ends straight above one another would
# leave the curve no width to be computed from.
_LEAST_WIDTH = 1e-4
_BISECTIONS = 80


def hanging_rope(grippers: ArrayLike, rope_length: float, n_nodes: int) -> Array:
    """Lay a rope from gripper to gripper: a catenary, or straight where it is taut.

    Parameters
    ----------
    grippers : array-like of shape (2, 3)
    rope_length : float
        Length at rest; a straight rope is stretched evenly where it is shorter.
    n_nodes : int

    Returns
    -------
    nodes : ndarray of shape (n_nodes, 3)
        Evenly spaced along the rope, from gripper A to gripper B.
    """
    first, last = as_finite_array(grippers, "grippers", (2, 3))
    fraction = np.linspace(0.0, 1.0, n_nodes)[:, None]
    if np.linalg.norm(last - first) >= rope_length * (1.0 - _TAUT):
        nodes = first + fraction * (last - first)
        nodes[-1] = last
        return nodes
    across, height = _catenary(last - first, rope_length, fraction[:, 0] * rope_length)
    nodes = first + across[:, None] * (last - first)
    nodes[:, 2] = first[2] + height
    nodes[-1] = last
    return nodes


def _catenary(span: Array, length: float, arc: Array) -> tuple[Array, Array]:
    """Fraction of the way across, and height above the first end, at each arc length."""
    rise = float(span[2])
    width = max(float(np.hypot(span[0], span[1])), _LEAST_WIDTH * length)
    slack = np.sqrt(length**2 - rise**2) / width
    if slack <= 1.0 + 1e-9:
        return arc / length, arc / length * rise
    low, high = 1e-6, 40.0
    for _ in range(_BISECTIONS):  # bisection for sinh(x) / x = slack
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.sinh(middle) < slack * middle else (low, middle)
    scale = width / (2.0 * low)
    left = np.arctanh(rise / length) - low
    slope = np.sinh(left) + arc / scale
    return (np.arcsinh(slope) - left) * scale / width, scale * (
        np.hypot(1.0, slope) - np.cosh(left)
    )
