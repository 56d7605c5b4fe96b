"""The loose rope: a cheap guess at how the rope itself hangs, carried beside the band.

The band forgets where the slack is; a loose rope remembers. Its nodes fall, its links go slack
but do not stretch, and where it rests it rubs: position-based dynamics, for about a tenth of what
MuJoCo takes (``benchmarks/rope_engines.py``). It errs by a centimetre or two, and now and then
about what the rope gets caught on, so what it says is a feature to learn from and no verdict.

It is a row of ``loose_dim(scene)`` numbers: the nodes between the grippers from A to B, metres in
the world frame, and then how far each of them moved in the last of the steps that every command
is carried out in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.loose_rope_kernels import move_loose_ropes
from systems.obstacles import Array
from systems.rope_scene import Scene


def loose_dim(scene: Scene) -> int:
    """Return how many numbers a loose rope in this scene takes."""
    return 6 * (scene.n_nodes - 2)


def loose_rope_at_rest(nodes: Array) -> Array:
    """Describe a rope that rests with its nodes, shape (n_nodes, 3), where they are."""
    inner = nodes[1:-1].ravel()
    return np.concatenate([inner, np.zeros_like(inner)])


def loose_nodes(loose: Array, grippers: Array) -> Array:
    """Return the nodes of one loose rope and its grippers, shape (n_nodes, 3)."""
    first, last = grippers.reshape(2, 3)
    return np.vstack([first, loose[: len(loose) // 2].reshape(-1, 3), last])


def propagate_loose_ropes(
    loose: Array, grippers: Array, command: Array, moves: NDArray[np.bool_], scene: Scene
) -> Array:
    """Let loose ropes follow their grippers.

    Parameters
    ----------
    loose : ndarray of shape (n, loose_dim)
    grippers : ndarray of shape (n, 6)
        Where they are before the command.
    command : ndarray of shape (n, 6)
        Displacements of gripper A and gripper B, metres.
    moves : ndarray of bool of shape (n,)
        Which of them are carried out; the other ropes stay as they are.
    scene : Scene

    Returns
    -------
    next_loose : ndarray of shape (n, loose_dim)

    References
    ----------
    Mueller et al. 2007, "Position Based Dynamics".
    """
    next_loose = np.empty_like(loose)
    spacing = scene.rope_length / (scene.n_nodes - 1)
    move_loose_ropes(
        loose, grippers, command, moves, spacing, scene.packed, scene.n_nodes, next_loose
    )
    return next_loose
