"""How a rope scene looks, as shapes."""

from __future__ import annotations

import numpy as np

from systems.drawing.shapes import BoxShape, Color, CylinderShape, Shape, SphereShape, TubeShape
from systems.rope.obstacles.shapes import Array, Box, Cylinder, Obstacle
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
        return BoxShape(np.array(obstacle.center), np.array(obstacle.half_extents), color=color)
    if isinstance(obstacle, Cylinder):
        # Columns are the cylinder's axes: its own z is the world's axis that it runs along.
        rotation = np.roll(np.eye(3), 2 - obstacle.axis, axis=1)
        return CylinderShape(
            np.array(obstacle.center), obstacle.radius, obstacle.half_length, rotation, color
        )
    return TubeShape(np.array([obstacle.start, obstacle.end]), obstacle.radius, color)
