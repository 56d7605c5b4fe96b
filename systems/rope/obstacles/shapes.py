"""Obstacles of a scene: boxes, cylinders and capsules, in metres in the world frame.

Users describe obstacles by objects. Compiled code reads them as the rows of one table, which
:func:`pack_obstacles` writes and whose columns are named here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from systems.validation import as_finite_array, is_integer, is_number

Array = NDArray[np.float64]
Point = tuple[float, float, float]
Range = tuple[float, float]

BOX, CYLINDER, CAPSULE = 0.0, 1.0, 2.0

# Columns of a packed obstacle: its kind and its centre, or the start of a capsule's core segment.
KIND, X, Y, Z = 0, 1, 2, 3
HALF_X, HALF_Y, HALF_Z = 4, 5, 6  # of a box: half of the length of each side
AXIS, HALF_LENGTH = 4, 5  # of a cylinder: the world axis that it runs along
CORE_X, CORE_Y, CORE_Z = 4, 5, 6  # of a capsule: the vector from start to end
RADIUS = 7  # of a cylinder or a capsule
PACKED_WIDTH = 8

# Metres: with sizes beyond these, physics engines fail or lose all accuracy.
SMALLEST_SIZE, LARGEST_SIZE = 1e-6, 1e6


@dataclass(frozen=True)
class Box:
    """An axis-aligned box.

    Attributes
    ----------
    center : array-like of shape (3,)
    half_extents : array-like of shape (3,)
        Half of the length of each side.
    name : str
        Names the obstacle in messages, and decides its colour in pictures.
    """

    center: Point
    half_extents: Point
    name: str = "box"

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", _as_point(self.center, "Box.center"))
        half_extents = _as_point(self.half_extents, "Box.half_extents")
        for extent in half_extents:
            _check_positive(extent, "Box.half_extents")
        object.__setattr__(self, "half_extents", half_extents)


@dataclass(frozen=True)
class Cylinder:
    """A solid cylinder along one of the world's axes.

    Attributes
    ----------
    center : array-like of shape (3,)
    radius, half_length : float
    axis : {0, 1, 2}
        The axis it runs along: x, y or z.
    name : str
    """

    center: Point
    radius: float
    half_length: float
    axis: int = 2
    name: str = "cylinder"

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", _as_point(self.center, "Cylinder.center"))
        _check_positive(self.radius, "Cylinder.radius")
        _check_positive(self.half_length, "Cylinder.half_length")
        if not is_integer(self.axis) or self.axis not in (0, 1, 2):
            raise ValueError(f"Cylinder.axis must be 0 (x), 1 (y) or 2 (z), got {self.axis!r}.")


@dataclass(frozen=True)
class Capsule:
    """All points within ``radius`` of the segment from ``start`` to ``end``.

    Attributes
    ----------
    start, end : array-like of shape (3,)
    radius : float
    name : str
    """

    start: Point
    end: Point
    radius: float
    name: str = "capsule"

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", _as_point(self.start, "Capsule.start"))
        object.__setattr__(self, "end", _as_point(self.end, "Capsule.end"))
        _check_positive(self.radius, "Capsule.radius")
        if np.linalg.norm(np.subtract(self.start, self.end)) < SMALLEST_SIZE:
            raise ValueError(
                f"Capsule.start and Capsule.end must differ by {SMALLEST_SIZE:g} m or more, got "
                f"{self.start} and {self.end}; move one of them."
            )


Obstacle = Box | Cylinder | Capsule


def box_from_ranges(x: Range, y: Range, z: Range, name: str) -> Box:
    """Return the box that spans a range of coordinates, (low, high), along each axis."""
    low, high = np.array([x, y, z]).T
    return Box(tuple(0.5 * (low + high)), tuple(0.5 * (high - low)), name)


def pack_obstacles(obstacles: Sequence[Obstacle]) -> Array:
    """Write obstacles as the rows of a table, for compiled code.

    Parameters
    ----------
    obstacles : sequence of Box, Cylinder or Capsule

    Returns
    -------
    packed : ndarray of shape (n, 8)
        Boxes first, then cylinders, then capsules, each in the given order.

    Raises
    ------
    ValueError
        If one of them is no obstacle.
    """
    for index, obstacle in enumerate(obstacles):
        if not isinstance(obstacle, Box | Cylinder | Capsule):
            raise ValueError(
                f"obstacles[{index}] must be a Box, a Cylinder or a Capsule, got {obstacle!r}."
            )
    rows = sorted((_packed_row(obstacle) for obstacle in obstacles), key=lambda row: row[0])
    return np.array(rows, dtype=np.float64).reshape(-1, PACKED_WIDTH)


def _packed_row(obstacle: Obstacle) -> tuple[float, ...]:
    if isinstance(obstacle, Box):
        return (BOX, *obstacle.center, *obstacle.half_extents, 0.0)
    if isinstance(obstacle, Cylinder):
        shape = (float(obstacle.axis), obstacle.half_length, 0.0, obstacle.radius)
        return (CYLINDER, *obstacle.center, *shape)
    axis = (end - start for start, end in zip(obstacle.start, obstacle.end, strict=True))
    return (CAPSULE, *obstacle.start, *axis, obstacle.radius)


def _as_point(values: Point, name: str) -> Point:
    x, y, z = as_finite_array(values, name, (3,)).tolist()
    return (x, y, z)


def _check_positive(value: float, name: str) -> None:
    # Comparing with a float16 makes the limits float16 too, of which the larger is too large.
    plain = value.item() if isinstance(value, np.generic) else value
    if not is_number(plain) or not SMALLEST_SIZE <= plain <= LARGEST_SIZE:
        raise ValueError(
            f"{name} must be positive and finite, from {SMALLEST_SIZE:g} to {LARGEST_SIZE:g} m, "
            f"got {value!r}."
        )
