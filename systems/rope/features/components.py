"""Into how many parts obstacles divide the region in which the rope may hang."""

from __future__ import annotations

import math

import numpy as np

from systems.rope.features.component_kernels import component_counts
from systems.rope.features.parabola_kernels import CELL
from systems.rope.obstacles.shapes import Array
from systems.rope.scene import Scene


def component_features(before: Array, after: Array, scene: Scene) -> Array:
    """Count the connected parts of a vertical region below each pair of grippers.

    The region lies between the straight line from gripper to gripper and a parabola that is as
    long as the rope may become. An obstacle that the rope could be hanging around is an occupied
    part of its own.

    Parameters
    ----------
    before, after : ndarray of shape (n, reduced_dim)
    scene : Scene

    Returns
    -------
    counts : ndarray of shape (n, 9)
        The number of all parts before, after, and its change; then that of the free parts, then
        that of the occupied parts.

    References
    ----------
    The region is that of the public code of McConachie et al. 2020.
    """
    parts, next_parts = _parts(before, scene), _parts(after, scene)
    triples = np.stack([parts, next_parts, next_parts - parts], axis=2)
    return triples.reshape(len(parts), 9)


def _parts(rows: Array, scene: Scene) -> Array:
    """Count all, the free and the occupied parts of each row's region, shape (n, 3)."""
    side = math.ceil(1.5 * scene.max_band_length / CELL) + 8
    counts = component_counts(rows, scene.packed, scene.max_band_length, side)
    return np.column_stack([counts.sum(axis=1), counts])
