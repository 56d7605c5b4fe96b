"""Random positions of the grippers, and ropes that hang between them free of obstacles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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
        drawn = np.concatenate([drawn, pairs[clear_pairs(scene, pairs, reach)]])
    return drawn[:n]


def clear_pairs(scene: Scene, pairs: Array, reach: float) -> NDArray[np.bool_]:
    """Say which pairs of gripper positions, shape (n, 6), are clear and within reach."""
    near = np.linalg.norm(pairs[:, 3:] - pairs[:, :3], axis=1) <= reach
    margins = gripper_margins(pairs, np.tile(scene.bounds, 2), scene.packed)
    clear: NDArray[np.bool_] = near & (margins >= GRIPPER_CLEARANCE)
    return clear


def draw_hanging_rope(scene: Scene, rng: np.random.Generator) -> Array | None:
    """Draw a rope that hangs free of obstacles, a start to learn from.

    In a scene whose rope starts laid over points, it hangs from its grippers over these.

    Returns
    -------
    nodes : ndarray of shape (n_nodes, 3), or None
        None if the draw is no such start: too near to the goal, with a gripper on the other one's
        side, or with the rope in an obstacle. Draw again then.
    """
    reach = scene.rope_length
    draped = len(scene.start_via) > 0
    pair = _draw_draped_pair(scene, rng) if draped else draw_grippers(scene, rng, 1, reach)
    grippers = pair.reshape(2, 3)
    if draped and not clear_pairs(scene, pair, reach)[0]:
        return None
    if scene.way_to_goal(grippers) < LEAST_WAY * scene.way_to_goal(scene.start):
        return None
    to_own_start = np.linalg.norm(grippers - scene.start, axis=1)
    if (to_own_start > np.linalg.norm(grippers - scene.start[::-1], axis=1)).any():
        return None
    n_checks = 1 + _CHECKS_PER_LINK * round(scene.rope_length / NODE_SPACING)
    if signed_distance(scene.lay_rope(grippers, n_checks), scene.packed).min() < ROPE_RADIUS:
        return None
    return scene.lay_rope(grippers, scene.n_nodes)


def _draw_draped_pair(scene: Scene, rng: np.random.Generator) -> Array:
    """Draw grippers, shape (1, 6), that a rope over ``start_via`` reaches, clear or not."""
    on_the_way = np.linalg.norm(np.diff(scene.start_via, axis=0), axis=1).sum()
    reach, share = scene.rope_length - float(on_the_way), rng.random()
    a = _draw_near(scene, rng, np.array(scene.start_via[0]), share * reach)
    b = _draw_near(scene, rng, np.array(scene.start_via[-1]), (1.0 - share) * reach)
    return np.concatenate([a, b])[None]


def _draw_near(scene: Scene, rng: np.random.Generator, place: Array, reach: float) -> Array:
    """Draw a position within bounds, in any direction and no farther from a place than reach."""
    way = rng.normal(size=3)
    position = place + reach * rng.random() / np.linalg.norm(way) * way
    return position.clip(*scene.bounds)
