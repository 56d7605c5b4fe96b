"""PBD ropes: cheap guesses at how the rope itself hangs, carried beside the band.

The band forgets where the slack is; a PBD rope remembers. Its nodes fall, its links go slack
but do not stretch, and where it rests it rubs: position-based dynamics. Two, one of which rubs
more while the other is thicker, take a tenth to a seventh of what MuJoCo takes
(``benchmarks.speed.rope_engines``). They err by a centimetre or two, and now and then about what
the rope gets caught on, though rarely both at once. A plan may overstretch neither, as it may not
overstretch the band; all else that they say is a feature to learn from.

They are a row of ``pbd_dim(scene)`` numbers. For each rope these are the nodes between the
grippers from A to B, metres in the world frame, and then how far each of them moved in the last
of the steps that every command is carried out in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.rope.obstacles.shapes import Array
from systems.rope.scene import ROPE_RADIUS, Scene
from systems.rope.slack.pbd_kernels import move_pbd_ropes

# Friction and radius of each. Only nodes are kept out of obstacles, and the links between them cut
# edges: so they are thicker than the rope. What depends on which of the two it is, is in doubt.
KINDS = np.array([[0.35, ROPE_RADIUS + 0.002], [0.25, ROPE_RADIUS + 0.004]])


def pbd_dim(scene: Scene) -> int:
    """Return how many numbers the PBD ropes of one state take in this scene."""
    return len(KINDS) * 6 * (scene.n_nodes - 2)


def pbd_ropes_at_rest(nodes: Array) -> Array:
    """Describe ropes that rest with their nodes, shape (n_nodes, 3), where they are."""
    inner = nodes[1:-1].ravel()
    return np.tile(np.concatenate([inner, np.zeros_like(inner)]), len(KINDS))


def pbd_nodes(loose: Array, grippers: Array) -> Array:
    """Return the nodes of a row's ropes and its grippers, shape (n_ropes, n_nodes, 3)."""
    inner = loose.reshape(len(KINDS), 2, -1, 3)[:, 0]
    ends = np.broadcast_to(grippers.reshape(2, 1, 1, 3), (2, len(KINDS), 1, 3))
    return np.concatenate([ends[0], inner, ends[1]], axis=1)


def propagate_pbd_ropes(
    loose: Array,
    grippers: Array,
    command: Array,
    moves: NDArray[np.bool_],
    scene: Scene,
    longest: float,
) -> tuple[Array, NDArray[np.bool_]]:
    """Let PBD ropes follow their grippers.

    Parameters
    ----------
    loose : ndarray of shape (n, pbd_dim)
    grippers : ndarray of shape (n, 6)
        Where they are before the command.
    command : ndarray of shape (n, 6)
        Displacements of gripper A and gripper B, metres.
    moves : ndarray of bool of shape (n,)
        Which of them are carried out; the other ropes stay as they are.
    scene : Scene
    longest : float
        Longest that a rope may become, metres.

    Returns
    -------
    next_pbd : ndarray of shape (n, pbd_dim)
    valid : ndarray of bool of shape (n,)
        Those of ``moves`` after which no rope is longer; ropes that would be stay as they are.

    References
    ----------
    Mueller et al. 2007, "Position Based Dynamics".
    """
    next_pbd, valid = np.empty_like(loose), moves.copy()
    spacing, n_nodes = scene.rope_length / (scene.n_nodes - 1), scene.n_nodes
    move_pbd_ropes(
        loose, grippers, command, valid, spacing, longest, KINDS, scene.packed, n_nodes, next_pbd
    )
    return next_pbd, valid
