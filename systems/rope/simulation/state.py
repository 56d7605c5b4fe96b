"""The true state of the rope."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from systems.rope.obstacles.shapes import Array
from systems.rope.scene import Scene
from systems.validation import as_finite_array

# Simulated ropes keep well within these limits: PyBullet's, whose constraints give way, end up to
# 6 mm away from the grippers, have links of up to 1.46 times their length at rest, and get at most
# 3 % shorter.
LARGEST_GAP = 0.012
LONGEST_LINK = 2.0
SHORTEST_ROPE = 0.9


@dataclass(frozen=True, eq=False)
class RopeState:
    """The true state x = [grippers, rope], in metres in the world frame.

    Attributes
    ----------
    grippers : ndarray of shape (2, 3)
        Positions of grippers A and B, which hold the first and the last node.
    nodes : ndarray of shape (n_nodes, 3)
        Points on the rope's centre line, from A to B. The engine "mujoco" joins them by straight
        capsules. With "pybullet" they are the middles of capsules, which meet between them: where
        the rope bends around an edge, straight lines from node to node cut the corner.
    simulation : ndarray or None
        What else the engine needs to go on from here; only the engine that wrote it can read it.
        None means that the rope is at rest, which any engine can start from.
    """

    grippers: Array
    nodes: Array
    simulation: Array | None = None

    def __repr__(self) -> str:
        first, last = np.round(self.grippers, 3).tolist()
        return f"<RopeState: {len(self.nodes)} nodes, grippers at {first} and {last}>"


def checked_rope(state: RopeState, scene: Scene) -> RopeState:
    """Return a state with float64 arrays, after checking that it can be of a scene's rope.

    Parameters
    ----------
    state : RopeState
    scene : Scene

    Returns
    -------
    state : RopeState
        ``simulation`` is not looked at.

    Raises
    ------
    ValueError
        If something is not finite or has another shape; if the nodes don't begin in gripper A and
        end in gripper B; or if they are too far apart, or too near together, for this rope.
    """
    grippers = as_finite_array(state.grippers, "state.grippers", (2, 3))
    nodes = as_finite_array(state.nodes, "state.nodes", (scene.n_nodes, 3))
    gaps = np.linalg.norm(nodes[[0, -1]] - grippers, axis=1)
    if gaps.max() > LARGEST_GAP:
        turned = np.linalg.norm(nodes[[-1, 0]] - grippers, axis=1).max() <= LARGEST_GAP
        remedy = (
            "They run from B to A: give state.nodes[::-1]." if turned else "Are both in metres?"
        )
        raise ValueError(
            "state.nodes must run from gripper A to gripper B, got a first node "
            f"{gaps[0]:.3g} m from A and a last node {gaps[1]:.3g} m from B. {remedy}"
        )
    links = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    shortest = SHORTEST_ROPE * scene.rope_length
    if links.max() > LONGEST_LINK * scene.link_length or links.sum() < shortest:
        raise ValueError(
            f"state.nodes must be evenly spaced along a rope of {scene.rope_length:g} m, "
            f"{scene.link_length:.3g} m from one to the next, got up to {links.max():.3g} m, and "
            f"{links.sum():.3g} m in all."
        )
    return replace(state, grippers=grippers, nodes=nodes)
