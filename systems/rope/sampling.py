"""Random positions of the grippers, and ropes that hang between them free of obstacles."""

from __future__ import annotations

import numpy as np

from systems.rope.catenary import hanging_rope
from systems.rope.gripper_kernels import gripper_margins
from systems.rope.obstacles.shapes import Array
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.scene import GRIPPER_CLEARANCE, NODE_SPACING, ROPE_RADIUS, Scene

# Starts are no nearer to the goal than this share of the distance between the scene's start and
# goal: from behind all obstacles there is nothing to learn.
LEAST_WAY = 0.75
# Draws for one pair of grippers before giving up.
_MOST_DRAWS = 200_000
# Points for each link at which a hanging rope is checked for collisions.
_CHECKS_PER_LINK = 4


def draw_grippers(scene: Scene, rng: np.random.Generator, n: int, reach: float) -> Array:
    """Draw gripper positions in clear space, no farther apart than ``reach``.

    Gripper A is uniform in the clear part of the world, gripper B in what is within reach of it.

    Parameters
    ----------
    scene : Scene
    rng : Generator
    n : int
    reach : float
        Metres.

    Returns
    -------
    grippers : ndarray of shape (n, 6)

    Raises
    ------
    ValueError
        If there is hardly any clear space.
    """
    low, high = scene.bounds[0] + GRIPPER_CLEARANCE, scene.bounds[1] - GRIPPER_CLEARANCE
    bounds = np.tile(scene.bounds, 2)
    drawn, n_draws = np.empty((0, 6)), 0
    while len(drawn) < n:
        if n_draws > _MOST_DRAWS * (1 + len(drawn)):
            raise ValueError(
                f"scene {scene.name!r} must have room for two grippers, and {n_draws} random "
                f"places were clear {len(drawn)} times. Give it wider bounds or fewer obstacles."
            )
        n_draws += 2 * n
        first = rng.uniform(low, high, size=(2 * n, 3))
        second = rng.uniform(np.maximum(low, first - reach), np.minimum(high, first + reach))
        pairs = np.hstack([first, second])
        near = np.linalg.norm(second - first, axis=1) <= reach
        clear = gripper_margins(pairs, bounds, scene.packed) >= GRIPPER_CLEARANCE
        drawn = np.concatenate([drawn, pairs[near & clear]])
    return drawn[:n]


def draw_hanging_rope(scene: Scene, rng: np.random.Generator) -> Array | None:
    """Draw a rope that hangs free of obstacles, a start to learn from.

    Returns
    -------
    nodes : ndarray of shape (n_nodes, 3), or None
        None if the draw is no such start: too near to the goal, with a gripper on the other one's
        side, or with the rope in an obstacle. Draw again then.
    """
    grippers = draw_grippers(scene, rng, 1, scene.rope_length).reshape(2, 3)
    way = np.linalg.norm(scene.goal - grippers)
    if way < LEAST_WAY * np.linalg.norm(scene.goal - scene.start):
        return None
    to_own_start = np.linalg.norm(grippers - scene.start, axis=1)
    if (to_own_start > np.linalg.norm(grippers - scene.start[::-1], axis=1)).any():
        return None
    n_checks = 1 + _CHECKS_PER_LINK * round(scene.rope_length / NODE_SPACING)
    rope = hanging_rope(grippers, scene.rope_length, n_checks)
    if signed_distance(rope, scene.packed).min() < ROPE_RADIUS:
        return None
    return hanging_rope(grippers, scene.rope_length, scene.n_nodes)
