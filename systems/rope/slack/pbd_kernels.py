"""Compiled position-based dynamics of PBD ropes: nodes that fall, hang and slide.

In each time step the nodes go on as they moved before, and fall; then links that are too long pull
their two nodes together, a few times over from end to end; then nodes are pushed out of obstacles.

Ropes that take the same number of steps are moved side by side, as *lanes*, which are the last
axis of every array: each link has to wait for the one before it, and meanwhile the processor works
on the other lanes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from systems.compilation import compiled
from systems.rope.obstacles.signed_distance_kernels import gradient, nearest_obstacle
from systems.rope.rope_length import length_between
from systems.rope.strides import LONGEST_STRIDE, RESTING_STEPS, STEPS_PER_STRIDE

# What gravity adds to a free node's displacement in each time step, in metres, and the share of
# the displacement that is kept, as in the MuJoCo simulation: 4 m/s² times (5 ms)², and 0.95 every
# other step.
FALL = 1e-4
KEPT = 0.975
# Times that all links are shortened, there and back, in each time step.
SWEEPS = 2
# Rows that are moved together: with a few the processor waits, hundreds do not fit into its cache.
MOST_TOGETHER = 16


class PbdModel(NamedTuple):
    """What PBD ropes are made of, and the obstacles around them.

    Attributes
    ----------
    n_nodes : int
        Nodes of each rope, with both ends.
    spacing : float
        Length of a link at rest, metres.
    kinds : ndarray of shape (n_ropes, 2)
        Friction and radius, in metres, of each rope of a row.
    packed : ndarray of shape (n_rows, 8)
    """

    n_nodes: int
    spacing: float
    kinds: Any
    packed: Any


class Lanes(NamedTuple):
    """Ropes that are moved together; the last axis of each array has one entry per rope.

    Attributes
    ----------
    nodes : ndarray of shape (n_nodes, 3, n_lanes)
        Positions; the first and the last are held by the grippers.
    moved : ndarray of shape (n_nodes, 3, n_lanes)
        Displacements in the last time step.
    before : ndarray of shape (n_nodes, 3, n_lanes)
        Positions before the present time step.
    clearance : ndarray of shape (n_nodes, n_lanes)
        Lower bounds of the nodes' distances to the obstacles.
    """

    nodes: Any
    moved: Any
    before: Any
    clearance: Any


@compiled
def read_rope(rope: Any, grippers: Any, lanes: Lanes, lane: int) -> None:
    """Read a PBD rope: its nodes between the grippers, then their last displacements."""
    last = lanes.nodes.shape[0] - 1
    half = 3 * (last - 1)
    for k in range(3):
        lanes.nodes[0, k, lane], lanes.nodes[last, k, lane] = grippers[k], grippers[3 + k]
        for i in range(last - 1):
            lanes.nodes[i + 1, k, lane] = rope[3 * i + k]
            lanes.moved[i + 1, k, lane] = rope[half + 3 * i + k]


@compiled
def write_rope(lanes: Lanes, lane: int, rope: Any) -> float:
    """Write what :func:`read_rope` reads; return how long the rope is."""
    last = lanes.nodes.shape[0] - 1
    half = 3 * (last - 1)
    for k in range(3):
        for i in range(last - 1):
            rope[3 * i + k] = lanes.nodes[i + 1, k, lane]
            rope[half + 3 * i + k] = lanes.moved[i + 1, k, lane]
    return length_between(lanes.nodes[::last, :, lane], lanes.nodes[1:last, :, lane])


@compiled(error_model="numpy")
def shorten_links(nodes: Any, i: int, spacing: float) -> None:
    """Pull nodes i and i + 1 of each rope together until their link is no longer than at rest."""
    j, last = i + 1, nodes.shape[0] - 1
    # The shares of the correction that either node takes: grippers do not give way.
    near = 0.0 if i == 0 else (1.0 if j == last else 0.5)
    far = 0.0 if j == last else (1.0 if i == 0 else 0.5)
    for lane in range(nodes.shape[2]):
        x = nodes[j, 0, lane] - nodes[i, 0, lane]
        y = nodes[j, 1, lane] - nodes[i, 1, lane]
        z = nodes[j, 2, lane] - nodes[i, 2, lane]
        # Nodes at one place make this minus infinity, which numpy's error model allows.
        excess = 1.0 - spacing / np.sqrt(x * x + y * y + z * z)
        excess = excess if excess > 0.0 else 0.0
        nodes[i, 0, lane] += near * excess * x
        nodes[i, 1, lane] += near * excess * y
        nodes[i, 2, lane] += near * excess * z
        nodes[j, 0, lane] -= far * excess * x
        nodes[j, 1, lane] -= far * excess * y
        nodes[j, 2, lane] -= far * excess * z


@compiled
def push_out(lanes: Lanes, i: int, lane: int, friction: float, radius: float, packed: Any) -> float:
    """Move a node out of the obstacles, with friction; return its distance to them."""
    nodes, before = lanes.nodes, lanes.before
    x, y, z = nodes[i, 0, lane], nodes[i, 1, lane], nodes[i, 2, lane]
    d, index = nearest_obstacle(x, y, z, packed)
    if d >= radius:
        return d
    gx, gy, gz = gradient(x, y, z, packed, index)
    depth = radius - d
    x = x + depth * gx - before[i, 0, lane]
    y = y + depth * gy - before[i, 1, lane]
    z = z + depth * gz - before[i, 2, lane]
    # The part of the displacement along the surface, of which friction takes some or all.
    away = x * gx + y * gy + z * gz
    u, v, w = x - away * gx, y - away * gy, z - away * gz
    slid = np.sqrt(u * u + v * v + w * w)
    held = 1.0 if slid <= friction * depth else friction * depth / slid
    nodes[i, 0, lane] = before[i, 0, lane] + x - held * u
    nodes[i, 1, lane] = before[i, 1, lane] + y - held * v
    nodes[i, 2, lane] = before[i, 2, lane] + z - held * w
    return radius


@compiled
def fall(lanes: Lanes) -> None:
    """Move free nodes on by their last displacements, and by gravity."""
    nodes, moved, before = lanes.nodes, lanes.moved, lanes.before
    for i in range(1, nodes.shape[0] - 1):
        for k in range(3):
            down = FALL if k == 2 else 0.0
            for lane in range(nodes.shape[2]):
                before[i, k, lane] = nodes[i, k, lane]
                nodes[i, k, lane] = nodes[i, k, lane] + moved[i, k, lane] - down


@compiled
def collide(lanes: Lanes, model: PbdModel) -> None:
    """Push nodes out of the obstacles, and note how far each has moved in this time step."""
    nodes, moved, before, clearance = lanes.nodes, lanes.moved, lanes.before, lanes.clearance
    kinds, n_lanes = model.kinds, nodes.shape[2]
    for i in range(1, nodes.shape[0] - 1):
        # A distance changes by no more than the node moved, so it is rarely computed anew.
        for lane in range(n_lanes):
            x = nodes[i, 0, lane] - before[i, 0, lane]
            y = nodes[i, 1, lane] - before[i, 1, lane]
            z = nodes[i, 2, lane] - before[i, 2, lane]
            clearance[i, lane] -= np.sqrt(x * x + y * y + z * z)
        for lane in range(n_lanes):
            friction, radius = kinds[lane % len(kinds)]
            if clearance[i, lane] < radius:
                clearance[i, lane] = push_out(lanes, i, lane, friction, radius, model.packed)
        for k in range(3):
            for lane in range(n_lanes):
                moved[i, k, lane] = KEPT * (nodes[i, k, lane] - before[i, k, lane])


@compiled
def step_ropes(lanes: Lanes, model: PbdModel) -> None:
    """Take one time step."""
    nodes, n_links = lanes.nodes, lanes.nodes.shape[0] - 1
    fall(lanes)
    for _ in range(SWEEPS):
        for i in range(n_links):
            shorten_links(nodes, i, model.spacing)
        for i in range(n_links - 1, -1, -1):
            shorten_links(nodes, i, model.spacing)
    collide(lanes, model)


@compiled
def carry_out(lanes: Lanes, commands: Any, n_strides: int, model: PbdModel) -> None:
    """Carry out commands of the grippers, shape (6, n_lanes), in strides; then rest."""
    nodes, before = lanes.nodes, lanes.before
    last = nodes.shape[0] - 1
    for stride in range(n_strides):
        share = (stride + 1) / n_strides
        for k in range(3):
            for lane in range(nodes.shape[2]):
                nodes[0, k, lane] = before[0, k, lane] + share * commands[k, lane]
                nodes[last, k, lane] = before[last, k, lane] + share * commands[3 + k, lane]
        for _ in range(STEPS_PER_STRIDE):
            step_ropes(lanes, model)
    for _ in range(RESTING_STEPS):
        step_ropes(lanes, model)


@compiled
def strides_of(command: Any) -> int:
    """Return how many strides a command of the grippers is carried out in."""
    longest = 0.0
    for k in (0, 3):
        square = command[k] ** 2 + command[k + 1] ** 2 + command[k + 2] ** 2
        longest = max(longest, np.sqrt(square))
    return max(1, int(np.ceil(longest / LONGEST_STRIDE - 1e-9)))


@compiled
def start_lanes(ropes: Any, grippers: Any, together: Any, model: PbdModel) -> Lanes:
    """Read the PBD ropes of some rows, one lane for each rope."""
    n_kinds, width = len(model.kinds), 6 * (model.n_nodes - 2)
    n_lanes = n_kinds * len(together)
    nodes, moved = np.zeros((model.n_nodes, 3, n_lanes)), np.zeros((model.n_nodes, 3, n_lanes))
    lanes = Lanes(nodes, moved, np.empty_like(nodes), np.zeros((model.n_nodes, n_lanes)))
    for lane in range(n_lanes):
        i, kind = together[lane // n_kinds], lane % n_kinds
        read_rope(ropes[i, kind * width : (kind + 1) * width], grippers[i], lanes, lane)
    lanes.before[:] = nodes
    return lanes


@compiled
def propagate_pbd_ropes(
    ropes: Any, grippers: Any, commands: Any, allowed: Any, model: PbdModel, max_length: float
) -> tuple[Any, Any]:
    """Let PBD ropes follow their grippers.

    Parameters
    ----------
    ropes : ndarray of shape (n, pbd_dim)
        See :mod:`systems.rope.slack.pbd_ropes`.
    grippers : ndarray of shape (n, 6) or wider
        Positions of gripper A and gripper B before the commands, metres, in the leading columns.
    commands : ndarray of shape (n, 6)
        Displacements of gripper A and gripper B, metres.
    allowed : ndarray of bool of shape (n,)
        Commands that are carried out.
    model : PbdModel
    max_length : float
        Longest that a rope may become, metres.

    Returns
    -------
    next_ropes : ndarray of shape (n, pbd_dim)
    valid : ndarray of bool of shape (n,)
        False, with the ropes left as they were, where the command is not allowed, or would make
        one of the ropes longer than ``max_length``.

    References
    ----------
    Mueller et al. 2007, "Position Based Dynamics".
    """
    next_ropes, valid = ropes.copy(), allowed.copy()
    n_kinds, width = len(model.kinds), 6 * (model.n_nodes - 2)
    n_strides = np.zeros(len(ropes), np.int64)
    for i in range(len(ropes)):
        if valid[i]:
            n_strides[i] = strides_of(commands[i])
    for strides in range(1, n_strides.max() + 1 if len(ropes) else 1):
        alike = np.flatnonzero(n_strides == strides)
        for first in range(0, len(alike), MOST_TOGETHER):
            together = alike[first : first + MOST_TOGETHER]
            lanes = start_lanes(ropes, grippers, together, model)
            moves = np.empty((6, n_kinds * len(together)))
            for lane in range(moves.shape[1]):
                moves[:, lane] = commands[together[lane // n_kinds]]
            carry_out(lanes, moves, strides, model)
            for lane in range(moves.shape[1]):
                i, kind = together[lane // n_kinds], lane % n_kinds
                rope = next_ropes[i, kind * width : (kind + 1) * width]
                valid[i] &= write_rope(lanes, lane, rope) <= max_length
            for i in together:
                if not valid[i]:
                    next_ropes[i] = ropes[i]
    return next_ropes, valid
