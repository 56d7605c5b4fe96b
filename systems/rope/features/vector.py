"""Features of rope transitions for classifiers of short vectors."""

from __future__ import annotations

import numpy as np

from systems.rope.band.band import band_length, checked_bands, gripper_separation
from systems.rope.features.components import component_features
from systems.rope.obstacles.shapes import Array
from systems.rope.scene import Scene

FEATURE_NAMES = (
    "gripper_separation_before",
    "gripper_separation_after",
    "band_length_before",
    "band_length_after",
    *(
        f"{parts}_{when}"
        for parts in ("parts", "free_parts", "occupied_parts")
        for when in ("before", "after", "change")
    ),
)


def vector_features(reduced: Array, next_reduced: Array, scene: Scene) -> Array:
    """Describe transitions of bands in thirteen numbers.

    They are the distance between the grippers before and after and the length of the band before
    and after, as shares of the largest length that is allowed; and nine counts of the parts into
    which obstacles divide the region below the grippers
    (:func:`systems.rope.features.components.component_features`).

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
    bands = before, after
    lengths = [*map(gripper_separation, bands), *map(band_length, bands)]
    shares = np.column_stack(lengths) / scene.max_band_length
    return np.hstack([shares, component_features(before, after, scene)])
