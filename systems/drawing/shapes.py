"""Shapes that a system is drawn with, in metres in the world frame."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from systems.validation import (
    as_any_array,
    as_finite_array,
    as_rotation,
    is_number,
    is_number_between,
)

Array = NDArray[np.float64]
Color = tuple[float, float, float, float]

GREY: Color = (0.72, 0.74, 0.77, 1.0)
_MOST_METRES = 1e9


def _identity() -> Array:
    return np.eye(3)


@dataclass(frozen=True, eq=False)
class SphereShape:
    """A ball to be drawn.

    Attributes
    ----------
    position : array-like of shape (3,)
        Its centre.
    radius : float
    color : (red, green, blue, opacity)
        Each from 0 to 1.
    """

    position: Array
    radius: float
    color: Color = GREY

    def __post_init__(self) -> None:
        _set_array(self, "position", (3,))
        _check_size(self, "radius")
        _check_color(self)


@dataclass(frozen=True, eq=False)
class BoxShape:
    """A box to be drawn.

    Attributes
    ----------
    position : array-like of shape (3,)
        Its centre.
    half_extents : array-like of shape (3,)
        Half of the length of each side.
    rotation : array-like of shape (3, 3), default=identity
        Rotation matrix from the box's frame to the world's.
    color : (red, green, blue, opacity)
        Each from 0 to 1.
    """

    position: Array
    half_extents: Array
    rotation: Array = field(default_factory=_identity)
    color: Color = GREY

    def __post_init__(self) -> None:
        _set_array(self, "position", (3,))
        _set_array(self, "half_extents", (3,))
        if not (self.half_extents > 0).all():
            raise ValueError(
                f"BoxShape.half_extents must be positive, got {self.half_extents.tolist()}."
            )
        _set_rotation(self)
        _check_color(self)


@dataclass(frozen=True, eq=False)
class CylinderShape:
    """A cylinder to be drawn, along the z axis of its own frame.

    Attributes
    ----------
    position : array-like of shape (3,)
        Its centre.
    radius, half_length : float
    rotation : array-like of shape (3, 3), default=identity
        Rotation matrix from the cylinder's frame to the world's.
    color : (red, green, blue, opacity)
        Each from 0 to 1.
    """

    position: Array
    radius: float
    half_length: float
    rotation: Array = field(default_factory=_identity)
    color: Color = GREY

    def __post_init__(self) -> None:
        _set_array(self, "position", (3,))
        _check_size(self, "radius")
        _check_size(self, "half_length")
        _set_rotation(self)
        _check_color(self)


@dataclass(frozen=True, eq=False)
class TubeShape:
    """A round tube along a line of points, with round ends: a rope, a cable or a link.

    Attributes
    ----------
    points : array-like of shape (n, 3)
        Two or more; points may coincide.
    radius : float
    color : (red, green, blue, opacity)
        Each from 0 to 1.
    """

    points: Array
    radius: float
    color: Color = GREY

    def __post_init__(self) -> None:
        _set_array(self, "points", (None, 3))
        if len(self.points) < 2:
            raise ValueError(f"TubeShape.points must be two or more, got {len(self.points)}.")
        _check_size(self, "radius")
        _check_color(self)


@dataclass(frozen=True, eq=False)
class MeshShape:
    """A surface of triangles to be drawn.

    Attributes
    ----------
    vertices : array-like of shape (n, 3)
        In the mesh's own frame.
    faces : array-like of int of shape (m, 3)
        Three vertices each, counter-clockwise as seen from outside.
    position : array-like of shape (3,), default=(0, 0, 0)
        Where the origin of the mesh's frame is.
    rotation : array-like of shape (3, 3), default=identity
        Rotation matrix from the mesh's frame to the world's.
    color : (red, green, blue, opacity)
        Each from 0 to 1.
    """

    vertices: Array
    faces: NDArray[np.int64]
    position: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array = field(default_factory=_identity)
    color: Color = GREY

    def __post_init__(self) -> None:
        _set_array(self, "vertices", (None, 3))
        faces = as_any_array(self.faces, "MeshShape.faces")
        fits = faces.ndim == 2 and faces.shape[1] == 3 and faces.dtype.kind in "iu"
        if not fits or (faces < 0).any() or (faces >= len(self.vertices)).any():
            raise ValueError(
                "MeshShape.faces must be an array of shape (m, 3) with the numbers of vertices, "
                f"got {faces!r}."
            )
        object.__setattr__(self, "faces", faces.astype(np.int64))
        _set_array(self, "position", (3,))
        _set_rotation(self)
        _check_color(self)

    @classmethod
    def prism(
        cls,
        outline: Array,
        low: float,
        high: float,
        *,
        position: Array | None = None,
        rotation: Array | None = None,
        color: Color = GREY,
    ) -> MeshShape:
        """Raise a convex outline in the x-y plane to a solid.

        Parameters
        ----------
        outline : array-like of shape (n, 2)
            Corners, counter-clockwise, each once.
        low, high : float
            z of the bottom and of the top.
        position, rotation, color
            As for the class.

        Returns
        -------
        prism : MeshShape
        """
        corners = as_finite_array(outline, "outline", (None, 2))
        n = len(corners)
        if n < 3:
            raise ValueError(f"outline must have three corners or more, got {n}.")
        # Sides have corners of their own, so that shading keeps the edges sharp.
        bottom, top = (np.column_stack([corners, np.full(n, z)]) for z in (low, high))
        here, there = np.arange(n), np.roll(np.arange(n), -1)
        fan = np.column_stack([np.zeros(n - 2, dtype=int), here[1:-1], here[2:]])
        sides = [
            np.column_stack([2 * n + here, 2 * n + there, 3 * n + there]),
            np.column_stack([2 * n + here, 3 * n + there, 3 * n + here]),
        ]
        return cls(
            np.vstack([bottom, top, bottom, top]),
            np.vstack([fan[:, ::-1], n + fan, *sides]),
            np.zeros(3) if position is None else position,
            np.eye(3) if rotation is None else rotation,
            color,
        )


Shape = SphereShape | BoxShape | CylinderShape | TubeShape | MeshShape


def _set_array(shape: Shape, name: str, dimensions: tuple[int | None, ...]) -> None:
    label = f"{type(shape).__name__}.{name}"
    # A copy, since the caller may go on to change what it gave.
    array = as_finite_array(getattr(shape, name), label, dimensions).copy()
    object.__setattr__(shape, name, array)


def _set_rotation(shape: BoxShape | CylinderShape | MeshShape) -> None:
    rotation = as_rotation(shape.rotation, f"{type(shape).__name__}.rotation").copy()
    object.__setattr__(shape, "rotation", rotation)


def _check_size(shape: Shape, name: str) -> None:
    value = getattr(shape, name)
    if not is_number_between(value, 0.0, _MOST_METRES) or value == 0.0:
        raise ValueError(
            f"{type(shape).__name__}.{name} must be positive and at most {_MOST_METRES:g} m, got "
            f"{value!r}."
        )


def _check_color(shape: Shape) -> None:
    color = shape.color
    parts = tuple(color) if isinstance(color, tuple | list | np.ndarray) else ()
    if len(parts) != 4 or not all(is_number(part) and 0 <= part <= 1 for part in parts):
        raise ValueError(
            f"{type(shape).__name__}.color must be (red, green, blue, opacity), each from 0 to 1, "
            f"got {color!r}."
        )
    object.__setattr__(shape, "color", tuple(float(part) for part in parts))
