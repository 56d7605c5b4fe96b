"""Rope scenes drawn at random, to learn from more than one.

A random scene is a room, longer along x than it is wide, that the rope has to cross from one end to
the other. Two kinds of walls may be in it:

- A wall across the room with a *slit*, an opening wide enough for the rope and its grippers.
- A *slotted wall* along the room. Its *slot*, level with the start, lets only the rope through, so
  the grippers go along either side of the wall, and the rope lies in the slot.

Where a scene has both, the rope has to pass slit and slot at once. Besides there are bars, pipes
and pillars that it may catch on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from systems.rope.obstacles.obstacle import Obstacle
from systems.rope.obstacles.shapes import Box, Capsule, Cylinder, box_from_ranges
from systems.rope.scene import NODE_SPACING, Scene
from systems.validation import RandomState, as_generator

LEAST_LINKS, MOST_LINKS = 25, 70
WALL_THICKNESS = 0.05
# Shares of the scenes that have a wall across, that have a slotted wall, and, of those with both,
# that have a bar beside the slot.
SHARE_WITH_WALL, SHARE_WITH_SLOT, SHARE_GUARDED = 0.7, 0.4, 0.5

# Half of the height and of the length of the room, metres.
_HEIGHT = 0.4
_HALF_LENGTH = 1.3
_MOST_DRAWS = 1000


def random_rope_scene(random_state: RandomState = None) -> Scene:
    """Draw a scene in which a rope has to pass walls with openings, bars, pipes and pillars.

    The rope has 25 to 70 links. It starts straight, across one end of a room whose width is
    proportional to its length; the goal is at the other end, with the grippers about half as far
    apart. There may be no way from start to goal.

    Parameters
    ----------
    random_state : int, Generator, RandomState, SeedSequence or None

    Returns
    -------
    scene : Scene
    """
    rng = as_generator(random_state)
    for _ in range(_MOST_DRAWS):
        try:
            return _draw_scene(rng)
        except ValueError:  # the start or the goal is in an obstacle
            continue
    raise RuntimeError(
        f"None of {_MOST_DRAWS} random scenes had its start and goal clear of obstacles."
    )


def has_slot_and_slit(scene: Scene) -> bool:
    """Tell whether the rope of a random scene must pass a slot and a slit.

    A slot is a narrow gap, for the rope alone, in a wall that parts the grippers; a slit is a gap
    in a wall across the way.

    Parameters
    ----------
    scene : Scene
        From :func:`random_rope_scene`, which names the walls.

    Returns
    -------
    has_both : bool
    """
    if not isinstance(scene, Scene):
        raise ValueError(f"scene must be a Scene, got {scene!r}.")
    return {"lower slotted wall", "lower wall"} <= {obstacle.name for obstacle in scene.obstacles}


def _draw_scene(rng: np.random.Generator) -> Scene:
    links = int(rng.integers(LEAST_LINKS, MOST_LINKS + 1))
    length = (links - 1) * NODE_SPACING
    half_width = 0.5 * length + 0.08
    width = (-half_width, half_width)
    obstacles: list[Obstacle] = [
        box_from_ranges((-_HALF_LENGTH, _HALF_LENGTH), width, (-_HEIGHT - 0.1, -_HEIGHT), "floor")
    ]
    wall_x = float(rng.uniform(-0.6, 0.6))
    wall = _Wall.drawn(rng, wall_x, half_width) if rng.random() < SHARE_WITH_WALL else None
    hooks: list[Obstacle] = []
    for i in range(int(rng.integers(1, 9))):
        draw = _HOOKS[rng.integers(len(_HOOKS))]
        hooks += draw(rng, wall_x if wall is not None else None, half_width, f"{i + 1}")
    slotted = _slotted_wall(rng, half_width) if rng.random() < SHARE_WITH_SLOT else []
    if wall is not None:
        obstacles += wall.obstacles(half_width, at_slot=bool(slotted))
    obstacles += [*hooks, *slotted]
    if wall is not None and slotted and rng.random() < SHARE_GUARDED:
        obstacles.append(_guard(rng, wall_x, slot_y=float(slotted[0].center[1])))
    return Scene(
        obstacles=obstacles,
        bounds=np.array([[-_HALF_LENGTH, width[0], -_HEIGHT], [_HALF_LENGTH, width[1], _HEIGHT]]),
        rope_length=length,
        start=np.array([[-1.1, 0.5 * length, 0.0], [-1.1, -0.5 * length, 0.0]]),
        goal=np.array([[1.1, 0.26 * length, 0.0], [1.1, -0.24 * length, 0.0]]),
        name="random scene",
    )


@dataclass(frozen=True)
class _Wall:
    """A wall across the room with a slit: a lying one at a height, or a standing one at a y."""

    x: float
    opening: float
    lying: bool
    place: float

    @classmethod
    def drawn(cls, rng: np.random.Generator, x: float, half_width: float) -> _Wall:
        opening = float(rng.uniform(0.09, 0.2))
        lying = bool(rng.random() < 0.7)
        place = rng.uniform(-0.2, 0.2) if lying else rng.uniform(-0.5, 0.5) * half_width
        return cls(x, opening, lying, float(place))

    def obstacles(self, half_width: float, at_slot: bool) -> list[Obstacle]:
        thick = (self.x, self.x + WALL_THICKNESS)
        # A rope that lies in a slot can pass only a slit at the height of the slot.
        place = 0.0 if at_slot else self.place
        low, high = place - 0.5 * self.opening, place + 0.5 * self.opening
        if self.lying or at_slot:
            width = (-half_width, half_width)
            return [
                box_from_ranges(thick, width, (-_HEIGHT, low), "lower wall"),
                box_from_ranges(thick, width, (high, _HEIGHT), "upper wall"),
            ]
        tall = (-_HEIGHT, _HEIGHT)
        return [
            box_from_ranges(thick, (-half_width, low), tall, "right wall"),
            box_from_ranges(thick, (high, half_width), tall, "left wall"),
        ]


def _slotted_wall(rng: np.random.Generator, half_width: float) -> list[Box]:
    """Draw a wall along the room with a slot, which keeps the grippers on either side of it."""
    y, slot = float(rng.uniform(-0.5, 0.5)) * half_width, 0.05
    along, thick = (-_HALF_LENGTH, float(rng.uniform(0.0, 0.8))), (y, y + WALL_THICKNESS)
    return [
        box_from_ranges(along, thick, (-_HEIGHT, -0.5 * slot), "lower slotted wall"),
        box_from_ranges(along, thick, (0.5 * slot, _HEIGHT), "upper slotted wall"),
    ]


def _guard(rng: np.random.Generator, wall_x: float, slot_y: float) -> Box:
    """Draw a bar on the wall across, beside the slot, just below a rope that lies in it."""
    reach, thick = float(rng.uniform(0.05, 0.5)), float(rng.uniform(0.03, 0.07))
    aside = float(rng.uniform(0.05, 0.25)) * float(rng.choice([-1.0, 1.0]))
    y, top = slot_y + aside, float(rng.uniform(-0.08, 0.0))
    return box_from_ranges(
        (wall_x - reach, wall_x), (y - 0.5 * thick, y + 0.5 * thick), (top - thick, top), "guard"
    )


def _bar(
    rng: np.random.Generator, wall_x: float | None, half_width: float, name: str
) -> list[Obstacle]:
    """Draw a bar along the room that points at the start, on the wall or free in the air."""
    end = wall_x if wall_x is not None and rng.random() < 0.7 else float(rng.uniform(-0.5, 0.7))
    start = max(-0.85, end - float(rng.uniform(0.06, 0.9)))
    thick = float(rng.uniform(0.03, 0.07))
    y, z = float(rng.uniform(-0.6, 0.6)) * half_width, float(rng.uniform(-0.25, 0.2))
    return [box_from_ranges((start, end), (y, y + thick), (z, z + thick), f"bar {name}")]


def _cross_bar(
    rng: np.random.Generator, wall_x: float | None, half_width: float, name: str
) -> list[Obstacle]:
    """Draw a bar from one side into the room, maybe with its end turned up or down."""
    side = float(rng.choice([-1.0, 1.0]))
    reach, thick = float(rng.uniform(0.2, 1.2)) * half_width, float(rng.uniform(0.03, 0.07))
    x, z = float(rng.uniform(-0.75, 0.7)), float(rng.uniform(-0.25, 0.2))
    ends = sorted((side * half_width, side * (half_width - reach)))
    bar = box_from_ranges((x, x + thick), (ends[0], ends[1]), (z, z + thick), f"cross bar {name}")
    if rng.random() < 0.5:
        return [bar]
    tip, turn = side * (half_width - reach), float(rng.uniform(-0.15, 0.15))
    tips, rises = sorted((tip, tip + side * thick)), sorted((z + thick, z + turn))
    turned = box_from_ranges(
        (x, x + thick), (tips[0], tips[1]), (rises[0], rises[1]), f"tip {name}"
    )
    return [bar, turned]


def _pipe(
    rng: np.random.Generator, wall_x: float | None, half_width: float, name: str
) -> list[Obstacle]:
    """Draw a standing cylinder with a pipe that sticks out of it."""
    x, y = float(rng.uniform(-0.5, 0.6)), float(rng.uniform(-0.5, 0.5)) * half_width
    radius, top = float(rng.uniform(0.03, 0.12)), float(rng.uniform(-0.1, 0.3))
    half_height = 0.5 * (top + _HEIGHT)
    stand = Cylinder((x, y, top - half_height), radius, half_height, 2, f"stand {name}")
    angle, reach = float(rng.uniform(0.0, 2.0 * np.pi)), radius + float(rng.uniform(0.05, 0.3))
    z, pipe_radius = float(rng.uniform(-0.2, top)), float(rng.uniform(0.015, 0.05))
    end = (x + reach * np.cos(angle), y + reach * np.sin(angle), z)
    return [stand, Capsule((x, y, z), end, pipe_radius, f"pipe {name}")]


def _pillar(
    rng: np.random.Generator, wall_x: float | None, half_width: float, name: str
) -> list[Obstacle]:
    """Draw a pillar from floor to ceiling."""
    x, y = float(rng.uniform(-0.95, 0.7)), float(rng.uniform(-0.6, 0.6)) * half_width
    thick = float(rng.uniform(0.05, 0.12))
    return [box_from_ranges((x, x + thick), (y, y + thick), (-_HEIGHT, _HEIGHT), f"pillar {name}")]


_Draw = Callable[[np.random.Generator, float | None, float, str], list[Obstacle]]
_HOOKS: tuple[_Draw, ...] = (_bar, _bar, _cross_bar, _cross_bar, _pipe, _pillar)
