"""Features of rope transitions: for classifiers of vectors, and by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.rope.band.band import band_length, checked_bands, gripper_separation
from systems.rope.features.clearance import clearance_features
from systems.rope.features.components import slice_counts
from systems.rope.features.voxels import voxel_features
from systems.rope.obstacles.shapes import Array
from systems.rope.scene import Scene


def vector_features(reduced: Array, next_reduced: Array, scene: Scene) -> Array:
    """Describe transitions of bands in thirteen numbers.

    They are the distance between the grippers before and after, the length of the band before
    and after, all as shares of the largest allowed length; then come the parts of the slice
    between the grippers (:func:`systems.rope.features.components.slice_counts`).

    Parameters
    ----------
    reduced, next_reduced : ndarray of shape (n, reduced_dim)
    scene : Scene

    Returns
    -------
    X : ndarray of shape (n, 13)

    References
    ----------
    McConachie et al. 2020, "Application to rope manipulation"; which numbers, from the authors'
    public code.
    """
    before = checked_bands(reduced, "reduced", scene)
    after = checked_bands(next_reduced, "next_reduced", scene, len(before))
    both = before, after
    lengths = [*map(gripper_separation, both), *map(band_length, both)]
    shares = np.column_stack(lengths) / scene.max_band_length
    return np.hstack([shares, slice_counts(before, after, scene)])


FEATURES: dict[str, Callable[[Array, Array, Scene], NDArray[Any]]] = {
    "voxels": voxel_features,
    "clearance": clearance_features,
    "vector": vector_features,
}
