"""Features of rope transitions: for classifiers of vectors, and by name."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.band import band_length, checked_bands, gripper_separation
from systems.obstacles import Array
from systems.rope_curtain import curtain_features
from systems.rope_feature_kernels import CELL, fill_components
from systems.rope_scene import Scene
from systems.rope_voxels import voxel_features


def vector_features(reduced: Array, next_reduced: Array, scene: Scene) -> Array:
    """Describe transitions of bands in thirteen numbers.

    They are the distance between the grippers before and after, the length of the band before
    and after, all as shares of the largest allowed length; then the numbers of connected parts
    of a vertical slice, before, after and their difference: of all, of the free, and of the
    occupied parts. The slice lies between the straight line from gripper to gripper and the
    parabola, as long as the rope may be, that hangs from it. A hook that could catch the rope
    is a part of its own.

    Parameters
    ----------
    reduced, next_reduced : ndarray of shape (n, reduced_dim)
    scene : Scene

    Returns
    -------
    X : ndarray of shape (n, 13)

    References
    ----------
    McConachie et al. 2020, "Application to rope manipulation"; the slice from the authors'
    public code.
    """
    before = checked_bands(reduced, "reduced", scene)
    after = checked_bands(next_reduced, "next_reduced", scene, len(before))
    both = before, after
    lengths = [*map(gripper_separation, both), *map(band_length, both)]
    columns = [length / scene.max_band_length for length in lengths]
    parts, next_parts = _slice_parts(before, scene), _slice_parts(after, scene)
    for kind in range(3):
        one, other = parts[:, kind], next_parts[:, kind]
        columns += [one, other, other - one]
    return np.column_stack(columns)


def _slice_parts(rows: Array, scene: Scene) -> Array:
    """Count all, the free and the occupied parts of each row's slice, shape (n, 3)."""
    side = math.ceil(1.5 * scene.max_band_length / CELL) + 8
    cells, stack = np.empty((side, side), np.uint8), np.empty(side * side, np.int64)
    counts = np.empty((len(rows), 2))
    fill_components(rows, scene.packed, scene.max_band_length, cells, stack, counts)
    return np.column_stack([counts.sum(axis=1), counts])


FEATURES: dict[str, Callable[[Array, Array, Scene], NDArray[Any]]] = {
    "voxels": voxel_features,
    "curtain": curtain_features,
    "vector": vector_features,
}
