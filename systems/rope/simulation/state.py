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
        Positions of grippers A and B, which hold the first and the last node.
    nodes : ndarray of shape (n_nodes, 3)
        The rope's centre line, from A to B.
    simulation : ndarray or None
        What else the engine needs to go on from here; only the engine that wrote it can read it.
        None means that the rope is at rest, which any engine can start from.
    """

    grippers: Array
    nodes: Array
    simulation: Array | None = None
