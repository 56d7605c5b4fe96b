"""Shapes and lines in a viser scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from planners.viewer.meshes import quaternion, tube_faces, tube_vertices
from systems.drawing.shapes import (
    BoxShape,
    Color,
    CylinderShape,
    Shape,
    SphereShape,
    TubeShape,
)
from systems.system import Array

# What says where a shape is, and not what it looks like.
_PLACE = ("points", "position", "rotation")


class ShapeNodes:
    """Shapes under one name in a viser scene, which can be moved.

    Parameters
    ----------
    scene : viser.SceneApi
    name : str
        The nodes are called name/0, name/1 and so on.
    """

    def __init__(self, scene: Any, name: str) -> None:
        self._scene = scene
        self._name = name
        self._shapes: list[Shape] = []
        self._handles: list[Any] = []

    def show(self, shapes: Sequence[Shape]) -> None:
        """Show these shapes in place of those before; what only moved is only moved."""
        for i, shape in enumerate(shapes):
            if i < len(self._shapes) and _differ_in_place_only(self._shapes[i], shape):
                _move(self._handles[i], self._shapes[i], shape)
            else:
                self._handles[i : i + 1] = [_add(self._scene, f"{self._name}/{i}", shape)]
        for handle in self._handles[len(shapes) :]:
            handle.remove()
        del self._handles[len(shapes) :]
        self._shapes = list(shapes)


def add_lines(
    scene: Any, name: str, points: Array, colors: Array | Color, thickness: float
) -> None:
    """Add lines, points of shape (n, 2, 3), in one colour or (n, 3); thickness in pixels."""
    if not len(points):
        return
    rows = np.broadcast_to(np.asarray(colors, dtype=np.float64)[..., :3], (len(points), 3))
    # viser takes the colours of lines for linear light, and those of meshes for sRGB.
    linear = np.where(rows <= 0.04045, rows / 12.92, ((rows + 0.055) / 1.055) ** 2.4)
    ends = np.repeat((255 * linear).round().astype(np.uint8)[:, None], 2, axis=1)
    scene.add_line_segments(name, points, ends, thickness=thickness, thickness_units="screen")


def _differ_in_place_only(one: Any, other: Any) -> bool:
    if type(one) is not type(other):
        return False
    if isinstance(one, TubeShape) and one.points.shape != other.points.shape:
        return False
    return all(
        np.array_equal(getattr(one, own.name), getattr(other, own.name))
        for own in fields(one)
        if own.name not in _PLACE
    )


def _move(handle: Any, before: Any, after: Any) -> None:
    changed = {
        name
        for name in _PLACE
        if hasattr(after, name) and not np.array_equal(getattr(before, name), getattr(after, name))
    }
    if "points" in changed:
        handle.vertices = tube_vertices(after.points, after.radius).astype(np.float32)
    if "position" in changed:
        handle.position = after.position
    if "rotation" in changed:
        handle.wxyz = quaternion(after.rotation)


def _add(scene: Any, name: str, shape: Shape) -> Any:
    *color, opacity = shape.color
    look: dict[str, Any] = {"color": tuple(color), "opacity": None if opacity == 1 else opacity}
    look["cast_shadow"] = look["receive_shadow"] = False
    if isinstance(shape, TubeShape):
        vertices = tube_vertices(shape.points, shape.radius)
        return scene.add_mesh_simple(name, vertices, tube_faces(len(shape.points)), **look)
    if isinstance(shape, SphereShape):
        return scene.add_icosphere(name, shape.radius, position=shape.position, **look)
    look |= {"position": shape.position, "wxyz": quaternion(shape.rotation)}
    if isinstance(shape, BoxShape):
        return scene.add_box(name, dimensions=2 * shape.half_extents, **look)
    if isinstance(shape, CylinderShape):
        return scene.add_cylinder(name, shape.radius, 2 * shape.half_length, **look)
    return scene.add_mesh_simple(
        name, shape.vertices, shape.faces, flat_shading=True, side="double", **look
    )
