"""Scenes that the car drives in: walled lots with obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from systems.car.geometry import PackedScene
from systems.validation import RandomState, as_finite_array, as_generator, check_finite, is_number

LOT_SIZE = 8.0
MIN_OBSTACLES, MAX_OBSTACLES = 5, 10
POINTS_AROUND = 48


@dataclass(frozen=True)
class Circle:
    """A round obstacle.

    Attributes
    ----------
    x, y : float
        Centre, in metres.
    radius : float
        In metres.
    """

    x: float
    y: float
    radius: float

    def __post_init__(self) -> None:
        check_finite(self.x, "x")
        check_finite(self.y, "y")
        if not is_number(self.radius) or not 0 < self.radius < np.inf:
            raise ValueError(f"radius must be a positive number, got {self.radius!r}.")

    @property
    def outline(self) -> NDArray[np.float64]:
        """Points around the edge, counter-clockwise, in metres, shape (48, 2): for pictures."""
        around = np.linspace(0, 2 * np.pi, POINTS_AROUND, endpoint=False)
        ring = np.column_stack([np.cos(around), np.sin(around)])
        return np.array([self.x, self.y]) + self.radius * ring


@dataclass(frozen=True)
class ConvexPolygon:
    """An obstacle with straight sides.

    Attributes
    ----------
    corners : tuple of (x, y)
        Three or more, in metres, counter-clockwise.
    """

    corners: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        corners = as_finite_array(self.corners, "corners", (None, 2))
        sides = np.roll(corners, -1, axis=0) - corners
        following = np.roll(sides, -1, axis=0)
        turns = sides[:, 0] * following[:, 1] - sides[:, 1] * following[:, 0]
        angles = np.arctan2(turns, np.sum(sides * following, axis=1))
        # The corners of a star all turn the same way too, but by more than 2π in all.
        if len(corners) < 3 or (turns <= 0).any() or angles.sum() > 3 * np.pi:
            raise ValueError(
                "corners must be those of a convex polygon, three or more, counter-clockwise, "
                f"got {self.corners!r}."
            )

    @property
    def outline(self) -> NDArray[np.float64]:
        """The corners, in metres, shape (n_corners, 2): for pictures."""
        return np.array(self.corners, dtype=np.float64)


@dataclass(frozen=True)
class CarScene:
    """A walled lot with obstacles.

    Attributes
    ----------
    obstacles : tuple of Circle or ConvexPolygon
    bounds : (x_min, y_min, x_max, y_max)
        The walls, in metres.
    """

    obstacles: tuple[Circle | ConvexPolygon, ...]
    bounds: tuple[float, float, float, float] = (0.0, 0.0, LOT_SIZE, LOT_SIZE)

    def __post_init__(self) -> None:
        low_x, low_y, high_x, high_y = as_finite_array(self.bounds, "bounds", (4,))
        if not (low_x < high_x and low_y < high_y):
            raise ValueError(f"bounds must be (x_min, y_min, x_max, y_max), got {self.bounds!r}.")
        if not isinstance(self.obstacles, Sequence):
            raise ValueError(
                f"obstacles must be a sequence of Circle or ConvexPolygon, got {self.obstacles!r}."
            )
        for obstacle in self.obstacles:
            if not isinstance(obstacle, Circle | ConvexPolygon):
                raise ValueError(f"obstacles must be Circle or ConvexPolygon, got {obstacle!r}.")


def rectangle(x: float, y: float, length: float, width: float, angle: float = 0.0) -> ConvexPolygon:
    """Return a rectangle with its centre at (x, y), its length along ``angle`` (radians)."""
    half = 0.5 * np.array([[-length, -width], [length, -width], [length, width], [-length, width]])
    cosine, sine = np.cos(angle), np.sin(angle)
    corners = half @ np.array([[cosine, sine], [-sine, cosine]]) + [x, y]
    return ConvexPolygon(tuple((float(cx), float(cy)) for cx, cy in corners))


def random_car_scene(random_state: RandomState = None) -> CarScene:
    """Draw a lot of 8 m by 8 m with 5 to 10 circles and rectangles anywhere in it.

    Parameters
    ----------
    random_state : None, int, SeedSequence, Generator or RandomState

    Returns
    -------
    scene : CarScene
    """
    rng = as_generator(random_state)
    obstacles: list[Circle | ConvexPolygon] = []
    for _ in range(rng.integers(MIN_OBSTACLES, MAX_OBSTACLES + 1)):
        x, y = rng.uniform(0, LOT_SIZE, 2)
        if rng.random() < 0.5:
            obstacles.append(Circle(float(x), float(y), float(rng.uniform(0.2, 0.7))))
        else:
            length, width = rng.uniform(0.3, 2.0, 2)
            angle = rng.uniform(-np.pi, np.pi)
            obstacles.append(rectangle(float(x), float(y), length, width, angle))
    return CarScene(tuple(obstacles))


def pack_scene(scene: CarScene) -> PackedScene:
    """Return a scene as arrays for compiled code."""
    n_corners = np.array([1 if isinstance(o, Circle) else len(o.corners) for o in scene.obstacles])
    bounding_circles = np.zeros((len(n_corners), 3))
    corners = np.zeros((len(n_corners), max(n_corners, default=1), 2))
    grown_by = np.zeros(len(n_corners))
    for i, obstacle in enumerate(scene.obstacles):
        if isinstance(obstacle, Circle):
            bounding_circles[i] = obstacle.x, obstacle.y, obstacle.radius
            corners[i, 0] = obstacle.x, obstacle.y
            grown_by[i] = obstacle.radius
        else:
            own = np.array(obstacle.corners)
            centre = own.mean(axis=0)
            bounding_circles[i] = *centre, np.linalg.norm(own - centre, axis=1).max()
            corners[i, : len(own)] = own
    x_min, y_min, x_max, y_max = map(float, scene.bounds)
    walls = x_min, y_min, x_max, y_max
    return PackedScene(bounding_circles, corners, n_corners.astype(np.int64), grown_by, walls)


SCENES = {
    "open_lot": CarScene(
        (Circle(2.6, 5.4, 0.5), Circle(5.6, 2.4, 0.6), rectangle(4.4, 4.6, 1.2, 0.7, 0.5))
    ),
    "slalom": CarScene(
        tuple(rectangle(x, y, 0.4, 2.4) for x, y in ((2.0, 1.2), (4.0, 2.8), (6.0, 1.2))),
        (0.0, 0.0, 8.0, 4.0),
    ),
    "narrow_gate": CarScene(
        (rectangle(4.0, 1.45, 0.4, 2.9), rectangle(4.0, 4.95, 0.4, 2.1)),
        (0.0, 0.0, 8.0, 6.0),
    ),
}
