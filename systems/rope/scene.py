"""A rope held by two grippers, among obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from systems.goal_region import GoalRegion
from systems.rope.catenary import laid_rope
from systems.rope.gripper_goal import GRIPPERS, GripperGoal
from systems.rope.obstacles.obstacle import OBSTACLE_KINDS, Obstacle
from systems.rope.obstacles.packing import pack_obstacles
from systems.rope.obstacles.shapes import Array, Point
from systems.rope.obstacles.signed_distance import signed_distance
from systems.validation import as_finite_array, as_numbers, check_within_bounds, is_number

ROPE_RADIUS = 0.01
NODE_SPACING = 0.02
# A gripper is a sphere around the point where it holds the rope. Plans keep its centre farther away
# from obstacles than it has to be.
GRIPPER_RADIUS = 0.023
GRIPPER_CLEARANCE = 0.03
# The longest displacement of both grippers together, in R^6, in one transition.
STEP_SIZE = 0.025
MAX_STRETCH = 1.15
# A reduced state has room for the longest band, so that both limits bound its size.
LONGEST_ROPE = 100.0
LARGEST_STRETCH = 10.0

_TOLERANCE = 1e-9
# What goals keep from the lower and from the upper bounds.
_MARGIN = np.array([[GRIPPER_CLEARANCE], [-GRIPPER_CLEARANCE]])


@dataclass(frozen=True, eq=False)
class Scene:
    """A rope, the obstacles around it, where it starts and where the grippers should end.

    Lengths are metres in the world frame, z up. At the start the rope hangs at rest between
    the grippers: straight where they are ``rope_length`` apart, as a catenary otherwise. Or it is
    laid over points of ``start_via``, hangs from each to the next, and comes to rest from there.

    Attributes
    ----------
    obstacles : sequence of Box, Cylinder, Capsule, Sphere or ConvexPolyhedron
    bounds : array-like of shape (2, 3)
        Lower and upper corner of the world, which the grippers do not leave.
    rope_length : float
        Length at rest, along the rope from one gripper to the other, at most 100 m. The lengths
        that the paper names (0.55, 0.87, 1.13 and 1.59 m) are ``max_stretch * rope_length``.
    start : array-like of shape (2, 3)
        Positions of gripper A and gripper B.
    goal : array-like of shape (2, 3) or (n_goals, 2, 3), GripperGoal, or GoalRegion
        Positions of gripper A and gripper B, or several such pairs, of which a plan has to reach
        one; a place for one gripper only; or a region of configurations of your own.
    max_stretch : float
        λ, from 1 to 10: the rope may not become longer than ``max_stretch * rope_length``.
    name : str
    start_via : array-like of shape (m, 3), default=()
        Points that the rope's centre line passes at the start, in order from gripper A to B, for
        a rope that is draped over something or lies on it. What the rope is longer than the way
        over them sags between them. At rest it has to be within 0.05 m of each, and on the same
        side of all obstacles.

    Raises
    ------
    ValueError
        If the rope or a gripper starts in an obstacle, the start overstretches the rope, the
        goal cannot be held, or a value is degenerate or not finite.

    References
    ----------
    McConachie et al. 2020, "Rope Manipulation Experiments".
    """

    obstacles: Sequence[Obstacle]
    bounds: Array
    rope_length: float
    start: Array
    goal: Array | GripperGoal | GoalRegion
    max_stretch: float = MAX_STRETCH
    name: str = "scene"
    start_via: Sequence[Point] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.obstacles, Sequence):
            raise ValueError(
                f"obstacles must be a sequence of {OBSTACLE_KINDS}, got {self.obstacles!r}."
            )
        object.__setattr__(self, "obstacles", tuple(self.obstacles))
        for field in ("bounds", "start"):
            object.__setattr__(self, field, _frozen_array(getattr(self, field), field, (2, 3)))
        object.__setattr__(self, "start_via", _as_points(self.start_via, "start_via"))
        object.__setattr__(self, "goal", _frozen_goal(self.goal))
        _check_scalars(self)
        for field in ("rope_length", "max_stretch"):
            if not isinstance(getattr(self, field), int):
                object.__setattr__(self, field, float(getattr(self, field)))
        if not (self.bounds[0] < self.bounds[1]).all():
            raise ValueError(
                "bounds must hold the lower corner and then the upper corner, got "
                f"{self.bounds.tolist()}."
            )
        _check_start(self)
        _check_goal(self)

    def __repr__(self) -> str:
        return (
            f"Scene({self.name!r}, {len(self.obstacles)} obstacles, "
            f"rope_length={self.rope_length:g}, max_stretch={self.max_stretch:g})"
        )

    @cached_property
    def packed(self) -> Array:
        """The obstacles as the table that distances are computed from, shape (n_rows, 8)."""
        return pack_obstacles(self.obstacles)

    @property
    def n_nodes(self) -> int:
        """Points along the rope, about 2 cm apart, the first and last in the grippers."""
        return max(3, round(self.rope_length / NODE_SPACING) + 1)

    @property
    def link_length(self) -> float:
        """Distance from node to node along the rope at rest, metres."""
        return self.rope_length / (self.n_nodes - 1)

    @property
    def max_band_length(self) -> float:
        """Length beyond which the rope is overstretched, metres."""
        return self.max_stretch * self.rope_length

    def start_rope(self) -> Array:
        """Return the rope's nodes at the start, shape (n_nodes, 3)."""
        return self.lay_rope(self.start, self.n_nodes)

    def lay_rope(self, grippers: Array, n_nodes: int) -> Array:
        """Return a rope laid from gripper to gripper over ``start_via``, shape (n_nodes, 3)."""
        return laid_rope(self._way(grippers), self.rope_length, n_nodes)

    def shortest_rope(self, grippers: Array) -> float:
        """Return the length of the way from gripper A over ``start_via`` to gripper B, metres."""
        return sum(float(np.linalg.norm(part)) for part in np.diff(self._way(grippers), axis=0))

    def way_to_goal(self, grippers: Array) -> float:
        """Return how far gripper positions, shape (2, 3), are from the nearest goal, in R^6."""
        if not isinstance(self.goal, np.ndarray):
            return float(self.goal.distance(grippers.reshape(1, 6))[0])
        return min(float(np.linalg.norm(goal - grippers)) for goal in self.goal.reshape(-1, 2, 3))

    def _way(self, grippers: Array) -> Array:
        via = np.reshape(np.array(self.start_via, dtype=np.float64), (-1, 3))
        return np.concatenate([grippers[:1], via, grippers[1:]])


def _frozen_array(values: ArrayLike, name: str, shape: tuple[int | None, ...]) -> Array:
    array = as_finite_array(values, name, shape).copy()
    array.flags.writeable = False
    return array


def _as_points(values: ArrayLike, name: str) -> tuple[Point, ...]:
    if isinstance(values, list | tuple) and not values:
        return ()
    return tuple((x, y, z) for x, y, z in as_finite_array(values, name, (None, 3)).tolist())


def _frozen_goal(goal: ArrayLike | GripperGoal | GoalRegion) -> Array | GripperGoal | GoalRegion:
    if isinstance(goal, GripperGoal | GoalRegion):
        return goal
    several = as_numbers(goal, "goal").ndim == 3
    array = _frozen_array(goal, "goal", (None, 2, 3) if several else (2, 3))
    if not array.size:
        raise ValueError("goal must hold at least one pair of gripper positions, got none.")
    return array


def _check_scalars(scene: Scene) -> None:
    if not is_number(scene.rope_length) or not 0.0 < scene.rope_length <= LONGEST_ROPE:
        raise ValueError(
            f"rope_length must be positive and at most {LONGEST_ROPE:g} m, got "
            f"{scene.rope_length!r}."
        )
    if not is_number(scene.max_stretch) or not 1.0 <= scene.max_stretch <= LARGEST_STRETCH:
        raise ValueError(
            f"max_stretch must be at least 1 and at most {LARGEST_STRETCH:g}, got "
            f"{scene.max_stretch!r}."
        )


def _check_start(scene: Scene) -> None:
    check_within_bounds(scene.start, scene.bounds, "start")
    apart = scene.shortest_rope(scene.start)
    if apart > scene.rope_length + _TOLERANCE:
        if len(scene.start_via):
            raise ValueError(
                f"rope_length must be at least the way from gripper A over start_via to gripper B, "
                f"{apart:.6g} m, got {scene.rope_length:g} m. Give a longer rope, or other points."
            )
        raise ValueError(
            f"The rope is shorter than the distance between the grippers at the start: "
            f"rope_length is {scene.rope_length:g} m, start puts them {apart:g} m apart "
            f"(stretched by {apart / scene.rope_length:.3g}, allowed {scene.max_stretch:g}). "
            "Give a longer rope_length or move the grippers together."
        )
    _check_clear(scene, scene.start, GRIPPER_RADIUS, "start")
    n_samples = int(np.ceil(scene.rope_length / (0.5 * ROPE_RADIUS))) + 1
    rope = scene.lay_rope(scene.start, n_samples)
    distances = signed_distance(rope, scene.packed)
    worst = int(distances.argmin())
    if distances[worst] < ROPE_RADIUS - 1e-6:
        raise ValueError(
            f"The rope starts in collision with {_nearest_name(scene, rope[worst])!r}: hanging "
            f"between the grippers{' and start_via' if len(scene.start_via) else ''} it passes "
            f"{rope[worst].round(4).tolist()}, {distances[worst]:.3g} m from it, and its radius is "
            f"{ROPE_RADIUS} m. Move the grippers of start or that obstacle, or change rope_length."
        )


def _check_goal(scene: Scene) -> None:
    if isinstance(scene.goal, GripperGoal):
        _check_gripper_goal(scene, scene.goal)
    elif isinstance(scene.goal, np.ndarray):
        several = scene.goal.ndim == 3
        for index, pair in enumerate(scene.goal.reshape(-1, 2, 3)):
            _check_pair(scene, pair, f"goal[{index}]" if several else "goal")


def _check_gripper_goal(scene: Scene, goal: GripperGoal) -> None:
    place = np.array(goal.position)
    check_within_bounds(place, scene.bounds + _MARGIN, "goal.position")
    if float(signed_distance(place, scene.packed)) < GRIPPER_CLEARANCE:
        raise _collision(scene, place, "goal", goal.gripper, GRIPPER_CLEARANCE)


def _check_pair(scene: Scene, grippers: Array, name: str) -> None:
    check_within_bounds(grippers, scene.bounds + _MARGIN, name)
    _check_clear(scene, grippers, GRIPPER_CLEARANCE, name)
    apart = float(np.linalg.norm(grippers[1] - grippers[0]))
    if not GRIPPER_CLEARANCE <= apart <= scene.max_band_length:
        raise ValueError(
            f"{name} puts the grippers {apart:g} m apart; give a goal between "
            f"{GRIPPER_CLEARANCE} m and {scene.max_band_length:g} m, the rope's length times "
            "max_stretch."
        )


def _check_clear(scene: Scene, grippers: Array, clearance: float, name: str) -> None:
    for letter, position in zip(GRIPPERS, grippers, strict=True):
        if float(signed_distance(position, scene.packed)) < clearance:
            raise _collision(scene, position, name, letter, clearance)


def _collision(
    scene: Scene, position: Array, name: str, letter: str, clearance: float
) -> ValueError:
    distance = float(signed_distance(position, scene.packed))
    return ValueError(
        f"{name} puts gripper {letter} in collision with {_nearest_name(scene, position)!r}: "
        f"{position.tolist()} is {distance:.3g} m from it, {clearance} m are needed. Move the "
        "gripper or that obstacle."
    )


def _nearest_name(scene: Scene, point: Array) -> str:
    distances = [
        float(signed_distance(point, pack_obstacles([obstacle]))) for obstacle in scene.obstacles
    ]
    return scene.obstacles[int(np.argmin(distances))].name
