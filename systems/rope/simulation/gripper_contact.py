"""How far the grippers may move before one touches an obstacle or leaves the world."""

from __future__ import annotations

import numpy as np

from systems.rope.obstacles.shapes import Array
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.scene import GRIPPER_RADIUS

# A move is looked at in places as far apart as this, in metres, for the first contact, which is
# then found more exactly by bisection.
CONTACT_SPACING = 0.001
CONTACT_BISECTIONS = 20


def gripper_clearance(grippers: Array, packed: Array) -> float:
    """Return the distance of the grippers' surfaces to the obstacles; negative in contact.

    Parameters
    ----------
    grippers : ndarray of shape (2, 3)
    packed : ndarray of shape (n_rows, 8)
    """
    return float(signed_distance(grippers, packed).min()) - GRIPPER_RADIUS


def share_without_contact(grippers: Array, move: Array, packed: Array) -> float:
    """Return the largest share of a move that keeps both grippers out of the obstacles.

    Parameters
    ----------
    grippers, move : ndarray of shape (2, 3)
        Positions before the move, and displacements, metres.
    packed : ndarray of shape (n_rows, 8)
    """
    longest = longest_displacement(move)
    if gripper_clearance(grippers, packed) >= longest:
        return 1.0
    shares = np.linspace(0.0, 1.0, 1 + int(np.ceil(longest / CONTACT_SPACING)))
    free = [gripper_clearance(grippers + share * move, packed) >= 0.0 for share in shares]
    if all(free):
        return 1.0
    first = free.index(False)
    low, high = shares[max(first - 1, 0)], shares[first]
    for _ in range(CONTACT_BISECTIONS):
        middle = 0.5 * (low + high)
        touches = gripper_clearance(grippers + middle * move, packed) < 0.0
        low, high = (low, middle) if touches else (middle, high)
    return float(low)


def share_within_bounds(grippers: Array, move: Array, bounds: Array) -> float:
    """Return the largest share of a move, at most 1, that keeps both grippers within bounds.

    Parameters
    ----------
    grippers, move : ndarray of shape (2, 3)
        Positions before the move, which are within bounds, and displacements, metres.
    bounds : ndarray of shape (2, 3)
    """
    low, high = bounds
    room = np.maximum(np.where(move > 0.0, high - grippers, grippers - low), 0.0)
    leaves = np.abs(move) > room
    return float((room[leaves] / np.abs(move[leaves])).min(initial=1.0))


def longest_displacement(move: Array) -> float:
    """Return how far the gripper moves that moves farther, metres."""
    return float(np.sqrt((move * move).sum(axis=1).max()))
