"""Compiled dynamics of the loose rope: links that fall, hang and slide while the ends are moved."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from systems.distance_kernels import gradient, nearest_obstacle

# Strides and steps are those of Γ. What gravity adds to a free node's displacement from step to
# step, in metres, and the share of it that is kept, are MuJoCo's: 4 m/s² times 5 ms squared, and
# 0.95 every other step.
LONGEST_STRIDE = 0.005
STEPS_PER_STRIDE = 2
RESTING_STEPS = 4
FALL = 1e-4
KEPT = 0.975
SWEEPS = 2


@njit(cache=True, nogil=True)
def read_nodes(row: Any, q: Any, nodes: Any, moved: Any) -> None:
    """Read a loose rope between grippers at ``q``: nodes, and their last displacements."""
    last = nodes.shape[0] - 1
    for k in range(3):
        nodes[0, k], nodes[last, k] = q[k], q[3 + k]
    half = 3 * (last - 1)
    for i in range(last - 1):
        for k in range(3):
            nodes[i + 1, k] = row[3 * i + k]
            moved[i + 1, k] = row[half + 3 * i + k]


@njit(cache=True, nogil=True)
def write_nodes(nodes: Any, moved: Any, row: Any) -> None:
    """Write what :func:`read_nodes` reads."""
    inner = nodes.shape[0] - 2
    for i in range(inner):
        for k in range(3):
            row[3 * i + k] = nodes[i + 1, k]
            row[3 * inner + 3 * i + k] = moved[i + 1, k]


@njit(cache=True, nogil=True)
def nodes_length(nodes: Any) -> float:
    """Length of a rope."""
    total = 0.0
    for i in range(nodes.shape[0] - 1):
        x, y, z = (
            nodes[i + 1, 0] - nodes[i, 0],
            nodes[i + 1, 1] - nodes[i, 1],
            nodes[i + 1, 2] - nodes[i, 2],
        )
        total += np.sqrt(x * x + y * y + z * z)
    return total


@njit(cache=True, nogil=True)
def shorten_link(nodes: Any, i: int, spacing: float) -> None:
    """Pull two neighbours together until their link is no longer than it should be."""
    j, last = i + 1, nodes.shape[0] - 1
    x, y, z = nodes[j, 0] - nodes[i, 0], nodes[j, 1] - nodes[i, 1], nodes[j, 2] - nodes[i, 2]
    square = x * x + y * y + z * z
    if square <= spacing * spacing:
        return
    excess = 1.0 - spacing / np.sqrt(square)
    # Grippers do not give way.
    near = 0.0 if i == 0 else (1.0 if j == last else 0.5)
    far = 0.0 if j == last else (1.0 if i == 0 else 0.5)
    nodes[i, 0] += near * excess * x
    nodes[i, 1] += near * excess * y
    nodes[i, 2] += near * excess * z
    nodes[j, 0] -= far * excess * x
    nodes[j, 1] -= far * excess * y
    nodes[j, 2] -= far * excess * z


@njit(cache=True, nogil=True)
def push_out(nodes: Any, i: int, before: Any, friction: float, radius: float, packed: Any) -> float:
    """Move a node out of the obstacles, and let it rub there; return how far from them it is."""
    d, index = nearest_obstacle(nodes[i, 0], nodes[i, 1], nodes[i, 2], packed)
    if d >= radius:
        return d
    gx, gy, gz = gradient(nodes[i, 0], nodes[i, 1], nodes[i, 2], packed[index])
    depth = radius - d
    x = nodes[i, 0] + depth * gx - before[i, 0]
    y = nodes[i, 1] + depth * gy - before[i, 1]
    z = nodes[i, 2] + depth * gz - before[i, 2]
    away = x * gx + y * gy + z * gz
    u, v, w = x - away * gx, y - away * gy, z - away * gz
    slid = np.sqrt(u * u + v * v + w * w)
    held = 1.0 if slid <= friction * depth else friction * depth / slid
    nodes[i, 0] = before[i, 0] + x - held * u
    nodes[i, 1] = before[i, 1] + y - held * v
    nodes[i, 2] = before[i, 2] + z - held * w
    return radius


@njit(cache=True, nogil=True)
def step_nodes(
    nodes: Any,
    moved: Any,
    before: Any,
    clear: Any,
    spacing: float,
    friction: float,
    radius: float,
    packed: Any,
) -> None:
    """Take one step; ``clear`` holds what each node surely is away from the obstacles."""
    last = nodes.shape[0] - 1
    for i in range(1, last):
        for k in range(3):
            before[i, k] = nodes[i, k]
            nodes[i, k] += moved[i, k]
        nodes[i, 2] -= FALL
    for _ in range(SWEEPS):
        for i in range(last):
            shorten_link(nodes, i, spacing)
        for i in range(last - 1, -1, -1):
            shorten_link(nodes, i, spacing)
    for i in range(1, last):
        x, y, z = nodes[i, 0] - before[i, 0], nodes[i, 1] - before[i, 1], nodes[i, 2] - before[i, 2]
        clear[i] -= np.sqrt(x * x + y * y + z * z)
        if clear[i] < radius:
            clear[i] = push_out(nodes, i, before, friction, radius, packed)
        for k in range(3):
            moved[i, k] = KEPT * (nodes[i, k] - before[i, k])


@njit(cache=True, nogil=True)
def move_ends(
    nodes: Any,
    moved: Any,
    before: Any,
    clear: Any,
    command: Any,
    spacing: float,
    friction: float,
    radius: float,
    packed: Any,
) -> None:
    """Carry out a command of the grippers in strides, then rest."""
    last, longest = nodes.shape[0] - 1, 0.0
    for k in (0, 3):
        square = command[k] ** 2 + command[k + 1] ** 2 + command[k + 2] ** 2
        longest = max(longest, np.sqrt(square))
    n_strides = max(1, int(np.ceil(longest / LONGEST_STRIDE - 1e-9)))
    for k in range(3):
        before[0, k], before[last, k] = nodes[0, k], nodes[last, k]
    clear[:] = 0.0
    for stride in range(n_strides):
        share = (stride + 1) / n_strides
        for k in range(3):
            nodes[0, k] = before[0, k] + share * command[k]
            nodes[last, k] = before[last, k] + share * command[3 + k]
        for _ in range(STEPS_PER_STRIDE):
            step_nodes(nodes, moved, before, clear, spacing, friction, radius, packed)
    for _ in range(RESTING_STEPS):
        step_nodes(nodes, moved, before, clear, spacing, friction, radius, packed)


@njit(cache=True, nogil=True)
def move_loose_ropes(
    rows: Any,
    q: Any,
    commands: Any,
    valid: Any,
    spacing: float,
    kinds: Any,
    packed: Any,
    n: int,
    out: Any,
) -> None:
    """Write where the loose ropes of valid rows go; the others are copied.

    ``q`` holds the grippers' positions before the commands, ``kinds`` the friction and the radius
    of each rope in a row; ``n`` counts nodes with both ends.
    """
    nodes, moved, before, clear = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n)
    width = 6 * (n - 2)
    for i in range(rows.shape[0]):
        if not valid[i]:
            out[i] = rows[i]
            continue
        for j in range(kinds.shape[0]):
            rope = slice(j * width, (j + 1) * width)
            read_nodes(rows[i, rope], q[i], nodes, moved)
            friction, radius = kinds[j, 0], kinds[j, 1]
            move_ends(nodes, moved, before, clear, commands[i], spacing, friction, radius, packed)
            write_nodes(nodes, moved, out[i, rope])
