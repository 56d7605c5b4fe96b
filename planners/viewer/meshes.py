"""Triangles and rotations for a viewer that knows no tubes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from systems.drawing.rings import ring_faces
from systems.system import Array

_N_SIDES = 10
# Rings of each round end, beside the one at the end point itself.
_N_END_RINGS = 2
_SHORTEST = 1e-12


def quaternion(rotation: Array) -> Array:
    """Return a rotation matrix as a quaternion w, x, y, z."""
    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    return np.array([w, x, y, z])


def tube_faces(n_points: int) -> NDArray[np.int64]:
    """Return the triangles of a tube along ``n_points`` points, (m, 3), for any such tube."""
    return ring_faces(n_points + 2 * _N_END_RINGS, _N_SIDES)


def tube_vertices(points: Array, radius: float) -> Array:
    """Return the vertices of a tube along points, (n, 3), that :func:`tube_faces` refers to."""
    directions = _directions(points)
    frames = _frames(directions)
    around = np.linspace(0, 2 * np.pi, _N_SIDES, endpoint=False)
    circle = np.column_stack([np.cos(around), np.sin(around)]) @ frames
    # A ring where the round end begins is the end point's own.
    angles = np.linspace(0, np.pi / 2, _N_END_RINGS + 1)[1:]
    out, width = radius * np.sin(angles)[:, None], np.cos(angles)[:, None, None]
    start = _rings(points[0] - out * directions[0], radius * width * circle[0])
    end = _rings(points[-1] + out * directions[-1], radius * width * circle[-1])
    return np.concatenate([start[::-1], _rings(points, radius * circle), end]).reshape(-1, 3)


def _rings(centres: Array, offsets: Array) -> Array:
    return centres[:, None] + offsets


def _directions(points: Array) -> Array:
    """Return the unit tangent at each point; points that coincide have that of a neighbour."""
    ways = np.diff(points, axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    real = np.flatnonzero(lengths > _SHORTEST)
    if not len(real):
        return np.tile([0.0, 0.0, 1.0], (len(points), 1))
    units = ways[real] / lengths[real, None]
    last = np.clip(np.searchsorted(real, np.arange(len(points)), side="left") - 1, 0, None)
    following = np.clip(np.searchsorted(real, np.arange(len(points))), None, len(real) - 1)
    mean = units[last] + units[following]
    norms = np.linalg.norm(mean, axis=1, keepdims=True)
    return np.where(norms > _SHORTEST, mean / np.maximum(norms, _SHORTEST), units[following])


def _frames(directions: Array) -> Array:
    """Return two unit vectors across each direction, (n, 2, 3), that turn as little as can be."""
    frames = np.empty((len(directions), 2, 3))
    across = np.eye(3)[np.abs(directions[0]).argmin()]
    for i, direction in enumerate(directions):
        across = across - (across @ direction) * direction
        norm = np.linalg.norm(across)
        if norm < _SHORTEST:
            across = np.cross(direction, np.eye(3)[np.abs(direction).argmin()])
            norm = np.linalg.norm(across)
        across = across / norm
        frames[i] = across, np.cross(direction, across)
    return frames
