"""How many parts obstacles make of the slice in which the rope would hang."""

from __future__ import annotations

import math

import numpy as np

from systems.rope.features.component_kernels import CELL, fill_components
from systems.rope.obstacles.shapes import Array
from systems.rope.scene import Scene


def slice_counts(before: Array, after: Array, scene: Scene) -> Array:
    """Count the connected parts of a vertical slice below each pair of grippers.

    The slice lies between the straight line from gripper to gripper and the parabola, as long as
    the rope may be, that hangs from it. A hook that could catch the rope is a part of its own.

    Parameters
    ----------
    before, after : ndarray of shape (n, reduced_dim)
    scene : Scene

    Returns
    -------
    counts : ndarray of shape (n, 9)
        Before, after and their difference: of all parts, of the free, and of the occupied.

    References
    ----------
    The slice is that of the authors' public code.
    """
    parts, next_parts = _parts(before, scene), _parts(after, scene)
    triples = np.stack([parts, next_parts, next_parts - parts], axis=2)
    return triples.reshape(len(parts), 9)


def _parts(rows: Array, scene: Scene) -> Array:
    """Count all, the free and the occupied parts of each row's slice, shape (n, 3)."""
    side = math.ceil(1.5 * scene.max_band_length / CELL) + 8
    cells, stack = np.empty((side, side), np.uint8), np.empty(side * side, np.int64)
    counts = np.empty((len(rows), 2))
    fill_components(rows, scene.packed, scene.max_band_length, cells, stack, counts)
    return np.column_stack([counts.sum(axis=1), counts])
