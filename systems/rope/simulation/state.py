"""The true state of the rope."""

from __future__ import annotations

from dataclasses import dataclass

from systems.rope.obstacles.shapes import Array


@dataclass(frozen=True, eq=False)
class RopeState:
    """The true state x = [grippers, rope], in metres in the world frame.

    Attributes
    ----------
    grippers : ndarray of shape (2, 3)
        They hold the first and the last node.
    nodes : ndarray of shape (n_nodes, 3)
        The rope's centre line.
    simulation : ndarray or None
        What else the engine that wrote it needs to go on from here. None stands for a rope at
        rest, which any engine can start from.
    """

    grippers: Array
    nodes: Array
    simulation: Array | None = None
