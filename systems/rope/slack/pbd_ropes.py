"""PBD ropes: cheap estimates of where the rope itself hangs, kept beside the band.

The band forgets where the slack of the rope is; a PBD rope, moved by position-based dynamics,
remembers: its nodes fall, its links go slack but do not stretch, and obstacles that it lies on
hold it back by friction. There are two, one with more friction, the other thicker; together they
take a tenth to a seventh of the time that MuJoCo takes (``benchmarks.speed.rope_engines``). Their
nodes are a centimetre or two from the rope's. Sometimes they are wrong about what the rope gets
caught on, but rarely both at once. A plan may overstretch neither of them, just as it may not
overstretch the band. All else that they tell is left to the classifier, as features.

A row holds them as ``pbd_dim(scene)`` numbers: for each rope the positions of the nodes between
the grippers, from A to B, in metres in the world frame; and then the displacement of each of these
nodes in the last time step.
"""

from __future__ import annotations

import numpy as np

from systems.rope.obstacles.shapes import Array
from systems.rope.scene import ROPE_RADIUS, Scene
from systems.rope.slack.pbd_kernels import PbdModel

# Friction and radius, in metres, of each PBD rope. Only nodes are kept out of obstacles, while the
# links between them cut edges, so the radii are larger than the rope's. Where the two ropes
# disagree, the outcome is uncertain.
KINDS = np.array([[0.35, ROPE_RADIUS + 0.002], [0.25, ROPE_RADIUS + 0.004]])
# Least and greatest factor of the friction in varied models. Where slack is dragged over the head
# of a thin peg, nodes slide over it one by one, and the true rope often holds where a PBD rope
# would if its friction were one and a half times to three times as much. With more than twice as
# much, PBD ropes also get caught on hooks that true ropes pass.
FRICTION_FACTORS = (0.5, 2.0)


def pbd_dim(scene: Scene) -> int:
    """Return how many numbers the PBD ropes of one state take in this scene."""
    return len(KINDS) * 6 * (scene.n_nodes - 2)


def pbd_model(scene: Scene) -> PbdModel:
    """Return what the PBD ropes in this scene are made of, for compiled code."""
    return PbdModel(scene.n_nodes, scene.link_length, KINDS, scene.packed)


def varied_pbd_model(scene: Scene, rng: np.random.Generator) -> PbdModel:
    """Return PBD ropes with another friction, drawn log-uniformly, for compiled code."""
    kinds = KINDS.copy()
    kinds[:, 0] *= np.exp(rng.uniform(*np.log(FRICTION_FACTORS)))
    return PbdModel(scene.n_nodes, scene.link_length, kinds, scene.packed)


def pbd_ropes_at_rest(nodes: Array) -> Array:
    """Return PBD ropes that are where a rope is, and at rest.

    Parameters
    ----------
    nodes : ndarray of shape (n_nodes, 3)
        The rope's, from gripper to gripper.

    Returns
    -------
    ropes : ndarray of shape (pbd_dim,)
    """
    inner = nodes[1:-1].ravel()
    return np.tile(np.concatenate([inner, np.zeros_like(inner)]), len(KINDS))
