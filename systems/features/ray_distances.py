"""How far it is to the nearest obstacle in given directions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.features.mujoco_obstacles import MujocoObstacles
from systems.validation import as_numbers, is_number

Array = NDArray[np.float64]
# A ray has arrived where an obstacle is nearer than this share of its reach.
ARRIVED = 1e-4
# A ray that passes closely along a surface moves in small steps, and may not get to its end.
MOST_STEPS = 200


def ray_distances(
    obstacles: Callable[[Array], Array], origins: ArrayLike, rays: ArrayLike, reach: float
) -> Array:
    """Return how far obstacles are along rays, such as a range finder measures.

    A ray advances by as much as its distance from the nearest obstacle (sphere tracing); the rays
    of a :class:`MujocoObstacles` are cast by MuJoCo.

    Parameters
    ----------
    obstacles : callable
        A signed-distance function: from points (..., d) to distances (...), negative inside
        obstacles, of the unit that the points have. It may tell less than the true distance, never
        more.
    origins : array-like of shape (..., d)
        Where the rays start, such as ``poses[:, None, :2]``.
    rays : array-like of shape (..., d)
        Directions, of any length but zero; broadcast with ``origins``. World frame: directions
        that are fixed to a body are ``from_body_frame(poses, ways) - poses[:, None, :2]``.
    reach : float
        Rays end here, at the latest.

    Returns
    -------
    distances : ndarray of shape (...)
        0 at the origin of a ray that starts inside an obstacle, ``reach`` where nothing is hit; up
        to ``reach`` / 10,000 too short.

    Raises
    ------
    ValueError
        If ``reach`` is not positive, or a ray has the length zero.

    Examples
    --------
    >>> import numpy as np
    >>> from systems import ray_distances
    >>> disc = lambda points: np.linalg.norm(points - [3.0, 0.0], axis=-1) - 1
    >>> ray_distances(disc, [[0.0, 0.0]], [[1.0, 0.0], [0.0, 1.0]], reach=5.0).round(2)
    array([2., 5.])
    """
    if not is_number(reach) or not 0 < reach < np.inf:
        raise ValueError(f"reach must be a positive number, got {reach!r}.")
    if not callable(obstacles) and not isinstance(obstacles, MujocoObstacles):
        raise ValueError(f"obstacles must be callable or a MujocoObstacles, got {obstacles!r}.")
    starts, ways = _together(as_numbers(origins, "origins"), as_numbers(rays, "rays"))
    if not np.isfinite(starts).all():
        raise ValueError("origins must be finite, got NaN or infinity.")
    length = np.linalg.norm(ways, axis=-1, keepdims=True)
    if not (length > 0).all() or not np.isfinite(length).all():
        raise ValueError("rays must be directions, of finite length and not zero.")
    if isinstance(obstacles, MujocoObstacles):
        return obstacles.cast(starts, ways / length, reach)
    flat = starts.reshape(-1, starts.shape[-1]), (ways / length).reshape(-1, starts.shape[-1])
    return _traced(obstacles, *flat, reach).reshape(starts.shape[:-1])


def _together(origins: Array, rays: Array) -> tuple[Array, Array]:
    """Return both with the shape that they broadcast to."""
    try:
        starts, ways = np.broadcast_arrays(origins, rays)
    except ValueError:
        starts = ways = np.empty(())
    if not starts.ndim:
        raise ValueError(
            "origins and rays must have shapes (..., d) that go together, got "
            f"{origins.shape} and {rays.shape}."
        )
    return starts, ways


def _traced(obstacles: Callable[[Any], Any], starts: Array, ways: Array, reach: float) -> Array:
    travelled = np.zeros(len(starts))
    moving = np.arange(len(starts))
    for _ in range(MOST_STEPS):
        if not len(moving):
            break
        points = starts[moving] + travelled[moving, None] * ways[moving]
        free = np.asarray(obstacles(points), dtype=np.float64)
        if free.shape != (len(points),):
            raise ValueError(
                f"obstacles must return one distance per point, shape ({len(points)},), "
                f"got {free.shape}."
            )
        travelled[moving] = np.minimum(travelled[moving] + np.maximum(free, 0), reach)
        moving = moving[(free > ARRIVED * reach) & (travelled[moving] < reach)]
    return travelled
