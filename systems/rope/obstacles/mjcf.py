"""Obstacles as geoms of a MuJoCo model (MJCF)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from systems.rope.obstacles.shapes import Box, Cylinder, Obstacle


def geom_xml(obstacle: Obstacle, attributes: str = "") -> str:
    """Return an obstacle's ``geom`` element, with further attributes."""
    if isinstance(obstacle, Box):
        size = numbers_xml(obstacle.half_extents)
        shape = f'type="box" pos="{numbers_xml(obstacle.center)}" size="{size}"'
    elif isinstance(obstacle, Cylinder):
        half = obstacle.half_length * np.eye(3)[obstacle.axis]
        ends = numbers_xml((*(obstacle.center - half), *(obstacle.center + half)))
        shape = f'type="cylinder" fromto="{ends}" size="{obstacle.radius}"'
    else:
        ends = numbers_xml((*obstacle.start, *obstacle.end))
        shape = f'type="capsule" fromto="{ends}" size="{obstacle.radius}"'
    return f"<geom {shape} {attributes}/>"


def numbers_xml(values: Iterable[float]) -> str:
    """Write numbers so that they are read again bit by bit."""
    return " ".join(repr(float(value)) for value in values)
