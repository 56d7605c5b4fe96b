"""Gripper paths made by hand: in each scene one that the hook catches and one that passes it."""

from __future__ import annotations

import numpy as np

from systems.rope.paper_scenes import load_scene

STEP = 0.025

# Every path is a list of positions of gripper A and gripper B. The rope hangs at rest between
# the first two.
_THROUGH_SLOT = [
    [(-1.1, 0.39, 0.0), (-1.1, -0.37, 0.0)],
    [(-1.1, 0.1, 0.0), (-1.1, -0.37, 0.0)],
    [(-0.8, 0.1, 0.0), (-0.8, -0.37, 0.0)],
]


def _simple_hook(start, half, apart):
    start = [tuple(row) for row in start]
    together = [(-1.1, 0.0, 0.0), start[1]]
    passed = [(-0.85, 0.0, 0.1), (-0.85, start[1][1], 0.1)]
    over_tip = [(-0.85, half, 0.15), (-0.85, -half, 0.15)]
    lowered = [(-0.85, half, 0.0), (-0.85, -half, 0.0)]
    through = [(1.1, half, 0.0), (1.1, -half, 0.0)]
    beside = [(-1.1, -0.1, 0.0), (-1.1, -0.1 - apart, 0.0)]
    beyond = [(1.1, -0.1, 0.0), (1.1, -0.1 - apart, 0.0)]
    return {
        "caught": [start, together, passed, over_tip, lowered, through],
        "free": [start, beside, beyond],
    }


PATHS = {
    "simple_hook_short": _simple_hook(load_scene("simple_hook_short").start, 0.1, 0.15),
    "simple_hook": _simple_hook(load_scene("simple_hook").start, 0.2, 0.26),
    "simple_hook_long": _simple_hook(load_scene("simple_hook_long").start, 0.25, 0.35),
    "simple_hook_very_long": _simple_hook(load_scene("simple_hook_very_long").start, 0.3, 0.5),
    "complex_hook": {
        "caught": [
            *_THROUGH_SLOT,
            [(-0.85, -0.05, 0.0), (-0.85, -0.35, 0.0)],
            [(0.2, -0.05, 0.0), (0.2, -0.35, 0.0)],
        ],
        "free": [
            *_THROUGH_SLOT,
            [(-0.8, 0.41, 0.0), (-0.8, -0.41, 0.0)],
            [(0.2, 0.41, 0.0), (0.2, -0.41, 0.0)],
        ],
    },
    "multi_hook": {
        "caught": [
            [(-0.65, -0.4, 0.4), (-0.35, -0.4, 0.4)],
            [(-0.65, -0.2, 0.25), (-0.35, -0.2, 0.25)],
            [(-0.65, 0.6, 0.25), (-0.35, 0.6, 0.25)],
        ],
        "free": [
            [(-0.69, -0.4, 0.4), (-0.61, -0.4, 0.4)],
            [(-0.69, -0.2, 0.25), (-0.61, -0.2, 0.25)],
            [(-0.69, 0.6, 0.25), (-0.61, 0.6, 0.25)],
        ],
    },
    "engine_assembly": {
        "caught": [
            [(-0.25, -0.5, 0.5), (0.25, -0.5, 0.5)],
            [(-0.25, 0.4, 0.5), (0.25, 0.4, 0.5)],
        ],
        "free": [
            [(-0.35, -0.5, 0.75), (0.35, -0.5, 0.75)],
            [(-0.35, 0.4, 0.75), (0.35, 0.4, 0.75)],
            [(-0.21, 0.4, 0.2), (0.18, 0.4, 0.2)],
        ],
    },
}


def path_commands(waypoints):
    """Cut the straight lines between waypoints into commands, of shape (T, 6), of one step."""
    corners = np.array(waypoints, dtype=float).reshape(-1, 6)
    moves = np.diff(corners, axis=0)
    counts = np.ceil(np.linalg.norm(moves, axis=1) / STEP - 1e-9).astype(int)
    return np.repeat(moves / counts[:, None], counts, axis=0)
