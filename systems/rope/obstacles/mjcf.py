"""Obstacles as geoms of a MuJoCo model (MJCF)."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence

import numpy as np

from systems.rope.obstacles.obstacle import Obstacle
from systems.rope.obstacles.polyhedron import ConvexPolyhedron
from systems.rope.obstacles.shapes import Box, Cylinder, Sphere


def meshes_xml(obstacles: Sequence[Obstacle]) -> str:
    """Return the ``mesh`` elements, for the ``asset`` section, that geoms of obstacles refer to."""
    polyhedra = (each for each in obstacles if isinstance(each, ConvexPolyhedron))
    meshes = {_mesh_name(each): np.ravel(each.corners) for each in polyhedra}
    return "".join(
        f'<mesh name="{name}" vertex="{numbers_xml(corners)}"/>' for name, corners in meshes.items()
    )


def geom_xml(obstacle: Obstacle, attributes: str = "") -> str:
    """Return an obstacle's ``geom`` element, with further attributes."""
    return f"<geom {_shape_xml(obstacle)} {attributes}/>"


def numbers_xml(values: Iterable[float]) -> str:
    """Write numbers so that they are read again bit by bit."""
    return " ".join(repr(float(value)) for value in values)


def _shape_xml(obstacle: Obstacle) -> str:
    if isinstance(obstacle, Box):
        size = numbers_xml(obstacle.half_extents)
        shape = f'type="box" pos="{numbers_xml(obstacle.center)}" size="{size}"'
        if not obstacle.is_rotated:
            return shape
        return f'{shape} xyaxes="{numbers_xml(np.transpose(obstacle.rotation)[:2].ravel())}"'
    if isinstance(obstacle, Cylinder):
        half = obstacle.half_length * obstacle.direction
        ends = numbers_xml((*(obstacle.center - half), *(obstacle.center + half)))
        return f'type="cylinder" fromto="{ends}" size="{obstacle.radius}"'
    if isinstance(obstacle, Sphere):
        return f'type="sphere" pos="{numbers_xml(obstacle.center)}" size="{obstacle.radius}"'
    if isinstance(obstacle, ConvexPolyhedron):
        return f'type="mesh" mesh="{_mesh_name(obstacle)}"'
    ends = numbers_xml((*obstacle.start, *obstacle.end))
    return f'type="capsule" fromto="{ends}" size="{obstacle.radius}"'


def _mesh_name(polyhedron: ConvexPolyhedron) -> str:
    digest = hashlib.blake2b(np.array(polyhedron.corners).tobytes(), digest_size=8)
    return f"mesh-{digest.hexdigest()}"
