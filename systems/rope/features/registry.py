"""The kinds of features of rope transitions, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray

from systems.rope.features import clearance, vector
from systems.rope.features.clearance import clearance_features
from systems.rope.features.vector import vector_features
from systems.rope.features.voxels import voxel_features
from systems.rope.obstacles.shapes import Array
from systems.rope.scene import Scene

FEATURES: dict[str, Callable[[Array, Array, Scene], NDArray[Any]]] = {
    "voxels": voxel_features,
    "clearance": clearance_features,
    "vector": vector_features,
}
# Voxel grids are 12,288 bytes, which have no names.
FEATURE_NAMES: dict[str, tuple[str, ...] | None] = {
    "voxels": None,
    "clearance": clearance.FEATURE_NAMES,
    "vector": vector.FEATURE_NAMES,
}
