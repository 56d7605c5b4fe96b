"""Distances from what stands in the scene of a MuJoCo model."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.features.mujoco_models import (
    OBSTACLE_GROUP,
    PROBE_RADIUS,
    ModelMemory,
    absolute,
    thread_model,
)
from systems.features.primitive_kernels import nearest_primitive
from systems.validation import as_numbers, check_finite

Array = NDArray[np.float64]
N_GROUPS = 6
FAR = 1e9  # metres; further obstacles are at this distance


class MujocoObstacles:
    """The signed distance of points from the obstacles of a MuJoCo model.

    Obstacles are all geoms that are fixed to the world, whether or not anything collides with
    them; what moves, such as the robot, is left out. The model is read when it is first needed, in
    each thread, so that an instance pickles, and can stand in a module or in a system.

    Parameters
    ----------
    model_file : str or path
        MJCF or URDF.
    ignore : sequence of str, default=()
        Names of geoms that are no obstacles, such as the floor a robot stands on.
    height : float, default=None
        Measure points x and y at this z. None takes points x, y and z.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind. When it is first called, if MuJoCo can't read the file
        or knows no geom of an ignored name.

    Examples
    --------
    >>> from pathlib import Path
    >>> from systems import MujocoObstacles
    >>> file = Path("wall.xml")
    >>> _ = file.write_text('''<mujoco><worldbody>
    ...   <geom type="box" pos="2 0 0" size="0.5 3 1"/>
    ... </worldbody></mujoco>''')
    >>> MujocoObstacles(file)([[0.0, 0.0, 0.0], [1.8, 0.0, 0.0]]).round(3)
    array([ 1.5, -0.3])
    >>> file.unlink()
    """

    def __init__(
        self,
        model_file: str | os.PathLike[str],
        ignore: Sequence[str] = (),
        height: float | None = None,
    ) -> None:
        self.model_file = absolute(model_file)
        if not isinstance(ignore, list | tuple) or not all(isinstance(n, str) for n in ignore):
            raise ValueError(f"ignore must be a sequence of names of geoms, got {ignore!r}.")
        if height is not None:
            check_finite(height, "height")
        self.ignore = tuple(ignore)
        self.height = height

    def __repr__(self) -> str:
        return f"MujocoObstacles({self.model_file!r}, ignore={self.ignore}, height={self.height})"

    def __call__(self, points: ArrayLike) -> Array:
        """Return the signed distance of each point from the nearest obstacle.

        Parameters
        ----------
        points : array-like of shape (..., 3), or (..., 2) with a height
            In metres, in the world's frame.

        Returns
        -------
        distances : ndarray of shape (...)
            In metres, negative inside an obstacle (of meshes, MuJoCo before 3.2.7 may say 0
            there); infinite where there are no obstacles.
        """
        places = self._in_space(points)
        flat = places.reshape(-1, 3)
        memory = thread_model(self.model_file, self.ignore)
        distances = nearest_primitive(flat, *memory.primitives)
        if memory.others:
            distances = _or_nearer(distances, memory, flat)
        return distances.reshape(places.shape[:-1])

    def cast(self, origins: Array, rays: Array, reach: float) -> Array:
        """Return how far rays get, as :func:`ray_distances` asks.

        Parameters
        ----------
        origins : ndarray of shape (..., d)
        rays : ndarray of shape (..., d)
            Of the length 1.
        reach : float

        Returns
        -------
        distances : ndarray of shape (...)
        """
        from mujoco import mj_ray

        starts, ways = self._in_space(origins), _widened(rays, 0.0)
        memory = thread_model(self.model_file, self.ignore)
        shown = (np.arange(N_GROUPS) == OBSTACLE_GROUP).astype(np.uint8)
        hit = np.zeros((1, 1), dtype=np.int32)
        lengths = [
            mj_ray(memory.model, memory.data, start, way, shown, True, -1, hit)
            for start, way in zip(starts.reshape(-1, 3), ways.reshape(-1, 3), strict=True)
        ]
        found = np.reshape(lengths, starts.shape[:-1]).astype(np.float64)
        found = np.where(found < 0, reach, np.minimum(found, reach))
        # From inside a geom, MuJoCo tells how far it is to the way out.
        return np.where(self(origins) <= 0, 0.0, found)

    def _in_space(self, points: ArrayLike) -> Array:
        places = as_numbers(points, "points")
        if not np.isfinite(places).all():
            raise ValueError("points must be finite, got NaN or infinity.")
        width = 3 if self.height is None else 2
        if not places.ndim or places.shape[-1] != width:
            hint = "x, y and z" if width == 3 else "x and y, since a height is given"
            raise ValueError(
                f"points must have the shape (..., {width}), {hint}, got {places.shape}."
            )
        return places if self.height is None else _widened(places, float(self.height))


def _widened(points: Array, z: float) -> Array:
    if points.shape[-1] == 3:
        return np.ascontiguousarray(points)
    return np.concatenate([points, np.full((*points.shape[:-1], 1), z)], axis=-1)


def _or_nearer(distances: Array, memory: ModelMemory, points: Array) -> Array:
    """Return the distances of points, (n, 3), from obstacles that are no primitives, if nearer."""
    from mujoco import mj_geomDistance

    # No obstacle is nearer than the sphere around it: most need not be measured.
    least = np.linalg.norm(points[:, None] - memory.centres, axis=2) - memory.radii
    position = memory.data.geom_xpos[memory.probe]
    for i, j in zip(*np.nonzero(least < distances[:, None]), strict=True):
        if least[i, j] < distances[i]:
            position[:] = points[i]
            found = mj_geomDistance(
                memory.model, memory.data, memory.probe, memory.others[j], FAR, None
            )
            distances[i] = min(distances[i], found + PROBE_RADIUS)
    return distances
