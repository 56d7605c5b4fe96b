"""How a car and its scene look, as shapes."""

from __future__ import annotations

import numpy as np

from systems.car.geometry import WHEELBASE
from systems.car.scenes import CarScene
from systems.drawing.shapes import BoxShape, Color, MeshShape, Shape, TubeShape
from systems.system import Array

# Metres, of what has no height of its own.
_CAR_LOW, _CAR_HIGH = 0.04, 0.2
_OBSTACLE_HEIGHT, _WALL_HEIGHT, _WALL_THICKNESS = 0.35, 0.2, 0.06
_LINE_RADIUS, _LINE_HEIGHT = 0.02, 0.03

_CAR_COLOR: Color = (0.20, 0.45, 0.70, 1.0)
_WINDOW_COLOR: Color = (0.10, 0.16, 0.24, 1.0)
_GROUND_COLOR: Color = (0.94, 0.94, 0.93, 1.0)
_WALL_COLOR: Color = (0.55, 0.57, 0.60, 1.0)
_OBSTACLE_COLOR: Color = (0.42, 0.45, 0.50, 1.0)
_GOAL_COLOR: Color = (0.82, 0.15, 0.55, 1.0)


def drawn_car(own_outline: Array, pose: Array) -> list[Shape]:
    """Return a car at a pose, from the outline of its footprint in its own frame, (n, 2)."""
    x, y, heading = pose[:3]
    cosine, sine = np.cos(heading), np.sin(heading)
    rotation = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    position = np.array([x, y, 0.0])
    window = rotation @ [0.75 * WHEELBASE, 0.0, _CAR_HIGH]
    return [
        MeshShape.prism(
            own_outline,
            _CAR_LOW,
            _CAR_HIGH,
            position=position,
            rotation=rotation,
            color=_CAR_COLOR,
        ),
        BoxShape(position + window, np.array([0.06, 0.1, 0.012]), rotation, _WINDOW_COLOR),
    ]


def drawn_scene(scene: CarScene) -> list[Shape]:
    """Return the ground, the walls and the obstacles of a scene."""
    x_min, y_min, x_max, y_max = scene.bounds
    centre = np.array([(x_min + x_max) / 2, (y_min + y_max) / 2])
    half = np.array([x_max - x_min, y_max - y_min]) / 2
    ground = BoxShape(np.array([*centre, -0.02]), np.array([*half, 0.02]), color=_GROUND_COLOR)
    obstacles = [
        MeshShape.prism(obstacle.outline, 0.0, _OBSTACLE_HEIGHT, color=_OBSTACLE_COLOR)
        for obstacle in scene.obstacles
    ]
    return [ground, *_walls(centre, half), *obstacles]


def drawn_goal(outline: Array, pose: Array) -> list[Shape]:
    """Return the outline of a footprint, (n, 2), and a line from its rear axle to its front."""
    x, y, heading = pose
    front = np.array([x, y]) + 1.4 * WHEELBASE * np.array([np.cos(heading), np.sin(heading)])
    lines = (outline, np.array([[x, y], front]))
    return [TubeShape(_on_ground(line), _LINE_RADIUS, _GOAL_COLOR) for line in lines]


def traced_axle(poses: Array) -> Array:
    """Return the middle of the rear axle at each pose, (n, 1, 3), near the ground."""
    return _on_ground(np.asarray(poses)[:, :2])[:, None]


def _walls(centre: Array, half: Array) -> list[Shape]:
    outer = half + _WALL_THICKNESS
    walls: list[Shape] = []
    for axis in (0, 1):
        extents = np.array([*outer, _WALL_HEIGHT]) / [1, 1, 2]
        extents[axis] = _WALL_THICKNESS / 2
        for side in (-1, 1):
            position = np.array([*centre, _WALL_HEIGHT / 2])
            position[axis] += side * (half[axis] + _WALL_THICKNESS / 2)
            walls.append(BoxShape(position, extents, color=_WALL_COLOR))
    return walls


def _on_ground(points: Array) -> Array:
    return np.column_stack([points, np.full(len(points), _LINE_HEIGHT)])
