"""The paper's seven rope scenes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from systems.rope.obstacles.obstacle import Obstacle
from systems.rope.obstacles.shapes import Box, Capsule, Cylinder, Range, box_from_ranges
from systems.rope.scene import NODE_SPACING, Scene
from systems.validation import check_choice

# Links of the rope's capsule chain in the paper's four lengths.
_SHORT, _REGULAR, _LONG, _VERY_LONG = 25, 39, 50, 70


def load_scene(name: str) -> Scene:
    """Return one of the paper's scenes.

    Parameters
    ----------
    name : str
        One of ``SCENE_NAMES``.

    Raises
    ------
    ValueError
        If there is no scene of that name.

    References
    ----------
    McConachie et al. 2020, "Scenarios"; positions and sizes from the authors' public
    configuration files.
    """
    check_choice(name, "name", SCENE_NAMES)
    return _SCENES[name]()


def _simple_hook(name: str, links: int, half_width: float, start: Range, goal: Range) -> Scene:
    x, z, y = (0.375, 0.425), (-0.4, 0.4), (-half_width, half_width)
    obstacles = (
        box_from_ranges((-1.05, -0.95), (0.15, 0.25), z, "pillar"),
        box_from_ranges(x, y, (-0.4, -0.05), "lower wall"),
        box_from_ranges(x, y, (0.05, 0.4), "upper wall"),
        box_from_ranges((-0.7, 0.375), (-0.025, 0.025), (-0.075, -0.025), "hook"),
        box_from_ranges(x, (-0.025, 0.025), (-0.05, -0.025), "lower blocker"),
        box_from_ranges(x, (-0.025, 0.025), (0.025, 0.05), "upper blocker"),
        box_from_ranges((-1.3, 1.3), y, (-0.5, -0.4), "floor"),
    )
    return _along_x(name, obstacles, links, half_width, start, goal)


def _complex_hook() -> Scene:
    x, y, z = (-0.625, -0.575), (-0.45, 0.45), (-0.4, 0.4)
    below, above = (-0.4, -0.025), (0.025, 0.4)
    obstacles = (
        box_from_ranges((-1.05, -0.95), (0.15, 0.25), z, "pillar"),
        box_from_ranges(x, y, (-0.4, -0.05), "lower wall"),
        box_from_ranges(x, y, (0.05, 0.4), "upper wall"),
        box_from_ranges((-1.3, 0.5), (-0.275, -0.225), below, "lower separator wall"),
        box_from_ranges((-1.3, 0.5), (-0.275, -0.225), above, "upper separator wall"),
        box_from_ranges((-0.7, -0.625), (-0.175, -0.125), (-0.075, -0.025), "hook"),
        box_from_ranges(x, (-0.225, -0.125), below, "lower blocker"),
        box_from_ranges(x, (-0.225, -0.125), above, "upper blocker"),
        box_from_ranges((-1.3, 1.3), y, (-0.5, -0.4), "floor"),
    )
    return _along_x("complex_hook", obstacles, _REGULAR, 0.45, (0.39, -0.37), (0.21, -0.18))


def _along_x(
    name: str,
    obstacles: tuple[Obstacle, ...],
    links: int,
    half_width: float,
    start: Range,
    goal: Range,
) -> Scene:
    return Scene(
        obstacles=obstacles,
        bounds=np.array(((-1.3, -half_width, -0.4), (1.3, half_width, 0.4))),
        rope_length=_rope_length(links),
        start=np.array(((-1.1, start[0], 0.0), (-1.1, start[1], 0.0))),
        goal=np.array(((1.1, goal[0], 0.0), (1.1, goal[1], 0.0))),
        name=name,
    )


def _multi_hook() -> Scene:
    z, slit_y = (0.0, 0.8), (-0.025, 0.025)
    middle, hook_y = (-0.025, 0.025), (0.4, 0.525)
    left, right = (-0.975, -0.025), (0.025, 0.975)
    obstacles = (
        box_from_ranges((-1.025, -0.975), (-0.8, 0.8), z, "outer wall at -x"),
        box_from_ranges((0.975, 1.025), (-0.8, 0.8), z, "outer wall at +x"),
        box_from_ranges((-1.0, 1.0), (-0.825, -0.775), z, "outer wall at -y"),
        box_from_ranges((-1.0, 1.0), (0.775, 0.825), z, "outer wall at +y"),
        box_from_ranges(middle, (-0.775, 0.4), z, "separator wall"),
        box_from_ranges(middle, hook_y, (0.275, 0.325), "lower separator hook"),
        box_from_ranges(middle, hook_y, (0.475, 0.525), "upper separator hook"),
        box_from_ranges((-0.525, -0.475), (-0.575, -0.525), z, "pillar"),
        box_from_ranges(left, slit_y, (0.0, 0.2), "lower left wall"),
        box_from_ranges(left, slit_y, (0.3, 0.8), "upper left wall"),
        *(_hook_row((-0.8, -0.5, -0.2), (-0.15, -0.025), (0.15, 0.20), "left hook")),
        box_from_ranges(right, slit_y, (0.0, 0.5), "lower right wall"),
        box_from_ranges(right, slit_y, (0.6, 0.8), "upper right wall"),
        *(_hook_row((0.2, 0.5, 0.8), (0.025, 0.15), (0.45, 0.50), "right hook")),
        box_from_ranges((-1.0, 1.0), (-0.8, 0.8), (-0.1, 0.0), "floor"),
    )
    return Scene(
        obstacles=obstacles,
        bounds=np.array(((-1.0, -0.8, 0.0), (1.0, 0.8, 0.8))),
        rope_length=_rope_length(_REGULAR),
        start=np.array(((-0.89, -0.6, 0.4), (-0.13, -0.6, 0.4))),
        goal=np.array(((0.29, -0.6, 0.4), (0.68, -0.6, 0.4))),
        name="multi_hook",
    )


def _engine_assembly() -> Scene:
    obstacles = (
        Box((0.0, 0.0, -0.05), (0.4, 0.6, 0.05), "floor"),
        Box((0.0, 0.0, 0.0625), (0.10, 0.175, 0.0625), "lower block"),
        Box((0.0, 0.0, 0.1375), (0.125, 0.20, 0.0125), "middle block"),
        Box((0.0, 0.0, 0.2125), (0.10, 0.175, 0.0625), "upper block"),
        Box((0.0, 0.0, 0.2875), (0.10, 0.15, 0.0125), "upper plate"),
        Cylinder((0.0, 0.0, 0.1375), 0.05, 0.15, 0, "shaft housing"),
        Cylinder((0.075, 0.0, 0.1375), 0.025, 0.15, 0, "shaft"),
        Cylinder((0.0, 0.0, 0.4375), 0.10, 0.1375, 2, "inner cylinder"),
        Cylinder((0.0, 0.0, 0.4375), 0.15, 0.1125, 2, "outer cylinder"),
        Capsule((0.0, -0.35, 0.425), (0.0, -0.05, 0.425), 0.05, "exhaust hook"),
        Cylinder((0.0, -0.40, 0.425), 0.025, 0.025, 1, "exhaust hook end"),
        Capsule((0.0, 0.10, 0.425), (0.0, 0.20, 0.425), 0.025, "intake hook"),
        Cylinder((0.0, 0.20, 0.4625), 0.025, 0.0375, 2, "intake hook end"),
    )
    return Scene(
        obstacles=obstacles,
        bounds=np.array(((-0.4, -0.6, 0.0), (0.4, 0.6, 0.8))),
        rope_length=_rope_length(_REGULAR),
        start=np.array(((-0.39, -0.5, 0.6), (0.37, -0.5, 0.6))),
        goal=np.array(((-0.21, 0.4, 0.2), (0.18, 0.4, 0.2))),
        name="engine_assembly",
    )


def _hook_row(centers: tuple[float, ...], y: Range, z: Range, name: str) -> list[Box]:
    return [box_from_ranges((x - 0.025, x + 0.025), y, z, name) for x in centers]


def _rope_length(links: int) -> float:
    return (links - 1) * NODE_SPACING


_SCENES: dict[str, Callable[[], Scene]] = {
    "simple_hook_short": lambda: _simple_hook(
        "simple_hook_short", _SHORT, 0.35, (0.25, -0.23), (0.14, -0.11)
    ),
    "simple_hook": lambda: _simple_hook(
        "simple_hook", _REGULAR, 0.45, (0.39, -0.37), (0.21, -0.18)
    ),
    "simple_hook_long": lambda: _simple_hook(
        "simple_hook_long", _LONG, 0.60, (0.50, -0.48), (0.26, -0.24)
    ),
    "simple_hook_very_long": lambda: _simple_hook(
        "simple_hook_very_long", _VERY_LONG, 0.80, (0.70, -0.68), (0.36, -0.34)
    ),
    "multi_hook": _multi_hook,
    "complex_hook": _complex_hook,
    "engine_assembly": _engine_assembly,
}
SCENE_NAMES = tuple(_SCENES)
