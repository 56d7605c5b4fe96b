"""Obstacles as the rows of one table, which compiled code reads.

Each obstacle begins with a row of its own: its kind and its centre, or the start of a capsule's
core segment, and its size. A shape that takes more numbers goes on in the rows below, whose kind
is CONTINUED. All columns are named here; lengths are metres in the world frame.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from systems.rope.obstacles.obstacle import OBSTACLE_KINDS, Obstacle
from systems.rope.obstacles.polyhedron import ConvexPolyhedron
from systems.rope.obstacles.shapes import Array, Box, Cylinder, Sphere

BOX, CYLINDER, CAPSULE, SLANTED_CYLINDER, SPHERE, ROTATED_BOX, POLYHEDRON = map(float, range(7))
CONTINUED = -1.0

KIND, X, Y, Z = 0, 1, 2, 3
HALF_X, HALF_Y, HALF_Z = 4, 5, 6  # of a box: half of the length of each side
AXIS, HALF_LENGTH = 4, 5  # of a cylinder: the world axis that it runs along
# Of a capsule: the vector from start to end. Of a slanted cylinder: from its centre to one end.
CORE_X, CORE_Y, CORE_Z = 4, 5, 6
N_FACES = 4  # of a polyhedron
RADIUS = 7  # of what is round; of a polyhedron: of a ball around its centre that it lies in
PACKED_WIDTH = 8

# A rotated box goes on with a row for each of its sides, whose direction is in X, Y and Z. A
# polyhedron goes on with two rows for each face, a triangle: its first corner in X, Y and Z and
# its outward normal; then the edges from the first corner to the second and to the third.
ROWS_OF_ROTATED_BOX = 4
ROWS_OF_FACE = 2
NORMAL_X, NORMAL_Y, NORMAL_Z = 4, 5, 6
OTHER_EDGE_X, OTHER_EDGE_Y, OTHER_EDGE_Z = 4, 5, 6


def pack_obstacles(obstacles: Sequence[Obstacle]) -> Array:
    """Write obstacles as the rows of a table, for compiled code.

    Parameters
    ----------
    obstacles : sequence of Box, Cylinder, Capsule, Sphere or ConvexPolyhedron

    Returns
    -------
    packed : ndarray of shape (n_rows, 8)
        Boxes first, then cylinders, then capsules and the rest, each in the given order. It has a
        row for each, and more for rotated boxes and polyhedra.

    Raises
    ------
    ValueError
        If one of them is no obstacle.
    """
    for index, obstacle in enumerate(obstacles):
        if not isinstance(obstacle, Obstacle):
            raise ValueError(f"obstacles[{index}] must be a {OBSTACLE_KINDS}, got {obstacle!r}.")
    blocks = sorted(map(_packed, obstacles), key=lambda rows: rows[0, KIND])
    return np.concatenate([np.empty((0, PACKED_WIDTH)), *blocks])


def _packed(obstacle: Obstacle) -> Array:
    if isinstance(obstacle, Box):
        return _packed_box(obstacle)
    if isinstance(obstacle, Cylinder):
        return _packed_cylinder(obstacle)
    if isinstance(obstacle, Sphere):
        return np.array([(SPHERE, *obstacle.center, 0.0, 0.0, 0.0, obstacle.radius)])
    if isinstance(obstacle, ConvexPolyhedron):
        return _packed_polyhedron(obstacle)
    axis = (end - start for start, end in zip(obstacle.start, obstacle.end, strict=True))
    return np.array([(CAPSULE, *obstacle.start, *axis, obstacle.radius)])


def _packed_box(box: Box) -> Array:
    size = (*box.center, *box.half_extents, 0.0)
    if not box.is_rotated:
        return np.array([(BOX, *size)])
    sides = _continued(ROWS_OF_ROTATED_BOX - 1)
    sides[:, X : Z + 1] = np.transpose(box.rotation)
    return np.vstack([(ROTATED_BOX, *size), sides])


def _packed_cylinder(cylinder: Cylinder) -> Array:
    if isinstance(cylinder.axis, int):
        shape = (float(cylinder.axis), cylinder.half_length, 0.0)
        return np.array([(CYLINDER, *cylinder.center, *shape, cylinder.radius)])
    core = cylinder.half_length * cylinder.direction
    return np.array([(SLANTED_CYLINDER, *cylinder.center, *core, cylinder.radius)])


def _packed_polyhedron(polyhedron: ConvexPolyhedron) -> Array:
    corners, (triangles, normals) = np.array(polyhedron.corners), polyhedron.faces
    center = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    radius = np.linalg.norm(corners - center, axis=1).max()
    first, second, third = triangles.swapaxes(0, 1)
    rows = _continued(ROWS_OF_FACE * len(triangles))
    rows[0::2, X : Z + 1], rows[0::2, NORMAL_X : NORMAL_Z + 1] = first, normals
    rows[1::2, X : Z + 1] = second - first
    rows[1::2, OTHER_EDGE_X : OTHER_EDGE_Z + 1] = third - first
    return np.vstack([(POLYHEDRON, *center, len(triangles), 0.0, 0.0, radius), rows])


def _continued(n_rows: int) -> Array:
    rows = np.zeros((n_rows, PACKED_WIDTH))
    rows[:, KIND] = CONTINUED
    return rows
