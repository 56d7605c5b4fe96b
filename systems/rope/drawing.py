"""How a rope scene looks, as shapes."""

from __future__ import annotations

import numpy as np

from systems.drawing.shapes import (
    BoxShape,
    Color,
    CylinderShape,
    MeshShape,
    Shape,
    SphereShape,
    TubeShape,
)
from systems.rope.obstacles.obstacle import Obstacle
from systems.rope.obstacles.polyhedron import ConvexPolyhedron
from systems.rope.obstacles.shapes import Array, Box, Cylinder, Sphere
from systems.rope.renderer import BAND_COLOR, GRIPPER_COLOR, ROPE_COLOR, obstacle_color
from systems.rope.scene import GRIPPER_RADIUS, ROPE_RADIUS, Scene

# The band has no thickness; thinner than the rope, it does not hide it.
_BAND_RADIUS = 0.8 * ROPE_RADIUS


def drawn_scene(scene: Scene) -> list[Shape]:
    """Return the obstacles of a scene, in the colours of :class:`systems.SceneRenderer`."""
    return [_drawn_obstacle(obstacle) for obstacle in scene.obstacles]


def drawn_rope(nodes: Array, grippers: Array) -> list[Shape]:
    """Return a rope, its nodes of shape (n, 3), and its grippers, (2, 3)."""
    return [TubeShape(nodes, ROPE_RADIUS, ROPE_COLOR), *_drawn_grippers(grippers)]


def drawn_band(points: Array) -> list[Shape]:
    """Return a band, its points of shape (n, 3), with grippers at its ends."""
    return [TubeShape(points, _BAND_RADIUS, BAND_COLOR), *_drawn_grippers(points[[0, -1]])]


def _drawn_grippers(positions: Array) -> list[Shape]:
    return [SphereShape(position, GRIPPER_RADIUS, GRIPPER_COLOR) for position in positions]


def _drawn_obstacle(obstacle: Obstacle) -> Shape:
    color: Color = obstacle_color(obstacle)
    if isinstance(obstacle, Box):
        center, half_extents = np.array(obstacle.center), np.array(obstacle.half_extents)
        return BoxShape(center, half_extents, np.array(obstacle.rotation), color)
    if isinstance(obstacle, Sphere):
        return SphereShape(np.array(obstacle.center), obstacle.radius, color)
    if isinstance(obstacle, ConvexPolyhedron):
        return _drawn_polyhedron(obstacle, color)
    if isinstance(obstacle, Cylinder):
        center, rotation = np.array(obstacle.center), _frame_along(obstacle.direction)
        return CylinderShape(center, obstacle.radius, obstacle.half_length, rotation, color)
    return TubeShape(np.array([obstacle.start, obstacle.end]), obstacle.radius, color)


def _frame_along(direction: Array) -> Array:
    """Return a rotation matrix whose last column is a direction."""
    across = np.cross(direction, np.eye(3)[np.abs(direction).argmin()])
    across /= np.linalg.norm(across)
    return np.column_stack([across, np.cross(direction, across), direction])


def _drawn_polyhedron(polyhedron: ConvexPolyhedron, color: Color) -> MeshShape:
    triangles, normals = polyhedron.faces
    sides = triangles[:, 1:] - triangles[:, :1]
    turned = (np.cross(sides[:, 0], sides[:, 1]) * normals).sum(axis=1) < 0.0
    # Each face has corners of its own, so that shading keeps the edges sharp.
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    faces[turned] = faces[turned][:, ::-1]
    return MeshShape(triangles.reshape(-1, 3), faces, color=color)
