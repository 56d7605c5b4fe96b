"""Compiled length of a rope from gripper to gripper."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled


@compiled
def length_between(grippers: Any, nodes: Any) -> float:
    """Length from gripper A along the nodes to gripper B, metres.

    Parameters
    ----------
    grippers : ndarray of shape (2, 3)
    nodes : ndarray of shape (n, 3)
    """
    total, x, y, z = 0.0, grippers[0, 0], grippers[0, 1], grippers[0, 2]
    for i in range(nodes.shape[0] + 1):
        end = nodes[i] if i < nodes.shape[0] else grippers[1]
        total += np.sqrt((end[0] - x) ** 2 + (end[1] - y) ** 2 + (end[2] - z) ** 2)
        x, y, z = end[0], end[1], end[2]
    return total
