"""Obstacles of a scene that are boxes or round, in metres in the world frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.validation import as_finite_array, as_rotation, is_integer, is_number_between

Array = NDArray[np.float64]
Point = tuple[float, float, float]
Matrix = tuple[Point, Point, Point]
Range = tuple[float, float]

# Metres: with sizes beyond these, physics engines fail or lose all accuracy.
SMALLEST_SIZE, LARGEST_SIZE = 1e-6, 1e6
UNROTATED = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
# Directions of this length, and rotation matrices whose product with their transpose is this near
# to the identity, are kept to the last digit.
_EXACT = 1e-14


@dataclass(frozen=True)
class Box:
    """A box, along the world's axes or rotated.

    Attributes
    ----------
    center : array-like of shape (3,)
    half_extents : array-like of shape (3,)
        Half of the length of each side.
    name : str
        Names the obstacle in messages, and decides its colour in pictures.
    rotation : array-like of shape (3, 3), default=identity
        Rotation matrix from the box's frame to the world's: its columns are the directions of the
        box's sides. ``scipy.spatial.transform.Rotation.as_matrix`` gives one.
    """

    center: Point
    half_extents: Point
    name: str = "box"
    rotation: Matrix = UNROTATED

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", _as_point(self.center, "Box.center"))
        half_extents = _as_point(self.half_extents, "Box.half_extents")
        for extent in half_extents:
            _check_positive(extent, "Box.half_extents")
        object.__setattr__(self, "half_extents", half_extents)
        object.__setattr__(self, "rotation", _as_rotation(self.rotation))

    @property
    def is_rotated(self) -> bool:
        """Whether its sides are not along the world's axes."""
        return self.rotation != UNROTATED


@dataclass(frozen=True)
class Cylinder:
    """A solid cylinder.

    Attributes
    ----------
    center : array-like of shape (3,)
    radius, half_length : float
    axis : {0, 1, 2} or array-like of shape (3,), default=2
        What it runs along: an axis of the world, x, y or z; or a direction of any length.
    name : str
    """

    center: Point
    radius: float
    half_length: float
    axis: int | Point = 2
    name: str = "cylinder"

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", _as_point(self.center, "Cylinder.center"))
        _check_positive(self.radius, "Cylinder.radius")
        _check_positive(self.half_length, "Cylinder.half_length")
        object.__setattr__(self, "axis", _as_axis(self.axis))

    @property
    def direction(self) -> Array:
        """The direction it runs along, of length 1, shape (3,)."""
        return np.eye(3)[self.axis] if isinstance(self.axis, int) else np.array(self.axis)


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


@dataclass(frozen=True)
class Sphere:
    """All points within ``radius`` of ``center``.

    Attributes
    ----------
    center : array-like of shape (3,)
    radius : float
    name : str
    """

    center: Point
    radius: float
    name: str = "sphere"

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", _as_point(self.center, "Sphere.center"))
        _check_positive(self.radius, "Sphere.radius")


def box_from_ranges(x: Range, y: Range, z: Range, name: str) -> Box:
    """Return the box that spans a range of coordinates, (low, high), along each axis."""
    low, high = np.array([x, y, z]).T
    return Box(tuple(0.5 * (low + high)), tuple(0.5 * (high - low)), name)


def _as_point(values: ArrayLike, name: str) -> Point:
    x, y, z = as_finite_array(values, name, (3,)).tolist()
    return (x, y, z)


def _check_positive(value: float, name: str) -> None:
    if not is_number_between(value, SMALLEST_SIZE, LARGEST_SIZE):
        raise ValueError(
            f"{name} must be positive and finite, from {SMALLEST_SIZE:g} to {LARGEST_SIZE:g} m, "
            f"got {value!r}."
        )


def _as_axis(axis: Any) -> int | Point:
    """Return the number of a world axis, or a direction of length 1."""
    if not isinstance(axis, list | tuple | np.ndarray):
        if not is_integer(axis) or axis not in (0, 1, 2):
            raise ValueError(
                "Cylinder.axis must be 0 (x), 1 (y) or 2 (z), or a direction of three numbers, "
                f"got {axis!r}."
            )
        return int(axis)
    direction = as_finite_array(axis, "Cylinder.axis", (3,))
    largest = np.abs(direction).max()
    if largest == 0.0:
        raise ValueError(f"Cylinder.axis must be a direction, whose length is not 0, got {axis!r}.")
    if abs(np.linalg.norm(direction / largest) * largest - 1.0) > _EXACT:
        direction = direction / largest  # Squares of huge and tiny numbers can't be represented.
        direction = direction / np.linalg.norm(direction)
    return _as_point(direction, "Cylinder.axis")


def _as_rotation(rotation: Any) -> Matrix:
    matrix = as_rotation(rotation, "Box.rotation")
    error = np.abs(matrix.T @ matrix - np.eye(3)).max()
    if error > _EXACT:
        left, _, right = np.linalg.svd(matrix)
        matrix = left @ right  # the nearest matrix that is orthogonal
    first, second, third = matrix.tolist()
    return (tuple(first), tuple(second), tuple(third))
