"""Whether a rope that was laid over points stays there."""

from __future__ import annotations

import numpy as np

from systems.rope.band.band import bands_close, reduce_rope
from systems.rope.obstacles.shapes import Array
from systems.rope.scene import Scene
from systems.rope.simulation.state import RopeState

# Metres: a rope that was laid over points has slid off if it comes to rest farther from one.
DRAPED_DISTANCE = 0.05


def stays_draped(nodes: Array, state: RopeState, scene: Scene) -> bool:
    """Say whether a rope, at rest, still is where the points of ``start_via`` put it.

    Parameters
    ----------
    nodes : ndarray of shape (n_nodes, 3)
        The rope as it was laid.
    state : RopeState
        The same rope at rest.
    scene : Scene
    """
    if not len(scene.start_via):
        return True
    points = np.array(scene.start_via)
    ways = np.linalg.norm(points[:, None] - state.nodes, axis=2)
    if (ways.min(axis=1) > DRAPED_DISTANCE).any():
        return False
    laid = reduce_rope(nodes, state.grippers, scene)
    rested = reduce_rope(state.nodes, state.grippers, scene)
    return bool(bands_close(laid[None], rested[None], scene)[0])
