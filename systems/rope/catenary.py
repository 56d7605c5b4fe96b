"""The catenary: the curve in which a rope hangs from gripper to gripper, or from point to point."""

from __future__ import annotations

import itertools

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


def laid_rope(points: ArrayLike, rope_length: float, n_nodes: int) -> Array:
    """Lay a rope over points: from each to the next it hangs as in :func:`hanging_rope`.

    Where it is longer than the way over the points, each part is longer by the same factor.

    Parameters
    ----------
    points : array-like of shape (m, 3)
        Gripper A, the points that the rope is laid over, gripper B.
    rope_length : float
        Length at rest.
    n_nodes : int

    Returns
    -------
    nodes : ndarray of shape (n_nodes, 3)
        Evenly spaced along the rope, from gripper A to gripper B.
    """
    points = as_finite_array(points, "points", (None, 3))
    ways = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if len(points) == 2 or not ways.any():
        return hanging_rope(points[[0, -1]], rope_length, n_nodes)
    lengths = ways * rope_length / ways.sum()
    parts = [
        hanging_rope(pair, length, n_nodes)
        for pair, length in zip(itertools.pairwise(points), lengths, strict=True)
    ]
    curve = np.concatenate([parts[0], *(part[1:] for part in parts[1:])])
    arc = np.append(0.0, np.linalg.norm(np.diff(curve, axis=0), axis=1).cumsum())
    places = np.linspace(0.0, arc[-1], n_nodes)
    nodes = np.column_stack([np.interp(places, arc, column) for column in curve.T])
    nodes[[0, -1]] = points[[0, -1]]
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
