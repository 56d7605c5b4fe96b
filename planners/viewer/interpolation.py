"""Shapes between two moments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from scipy.spatial.transform import Rotation

from systems.drawing.shapes import Shape, SphereShape, TubeShape
from systems.system import Array


def shapes_at(moments: Sequence[Sequence[Shape]], share: float) -> list[Shape]:
    """Return the shapes at a share, from 0 to 1, of a motion through equally spaced moments."""
    place = share * (len(moments) - 1)
    before = min(int(place), len(moments) - 1)
    after = min(before + 1, len(moments) - 1)
    return shapes_between(moments[before], moments[after], place - before)


def shapes_between(one: Sequence[Shape], other: Sequence[Shape], share: float) -> list[Shape]:
    """Return shapes on a straight way from one moment to another.

    Positions and points move in proportion, rotations about a fixed axis. Shapes that the other
    moment has no match for stay as they are.
    """
    if share == 0 or len(one) != len(other):
        return list(one)
    return [_between(a, b, share) for a, b in zip(one, other, strict=True)]


def _between(one: Any, other: Any, share: float) -> Shape:
    if type(one) is not type(other):
        return one
    if isinstance(one, TubeShape):
        fits = one.points.shape == other.points.shape
        return replace(one, points=_mean(one.points, other.points, share)) if fits else one
    position = _mean(one.position, other.position, share)
    if isinstance(one, SphereShape):
        return replace(one, position=position)
    return replace(one, position=position, rotation=_turned(one.rotation, other.rotation, share))


def _mean(one: Array, other: Array, share: float) -> Array:
    return one + share * (other - one)


def _turned(one: Array, other: Array, share: float) -> Array:
    way = Rotation.from_matrix(one.T @ other).as_rotvec()
    turned: Array = one @ Rotation.from_rotvec(share * way).as_matrix()
    return turned
