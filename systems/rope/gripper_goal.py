"""A goal for one of the grippers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from systems.rope.obstacles.shapes import Array, Point
from systems.validation import as_finite_array, check_choice

GRIPPERS = ("A", "B")


@dataclass(frozen=True)
class GripperGoal:
    """One gripper at a place; the other one may be anywhere.

    Give it as the goal of a :class:`systems.Scene`. Plans end at most 0.025 m away from it.

    Attributes
    ----------
    gripper : {"A", "B"}
    position : array-like of shape (3,)
        Metres in the world frame.

    Raises
    ------
    ValueError
        If there is no such gripper, or the position is not three finite numbers.
    """

    gripper: str
    position: Point

    def __post_init__(self) -> None:
        check_choice(self.gripper, "GripperGoal.gripper", GRIPPERS)
        x, y, z = as_finite_array(self.position, "GripperGoal.position", (3,)).tolist()
        object.__setattr__(self, "position", (x, y, z))

    def distance(self, configurations: Array) -> Array:
        """Return how far the gripper is from the place, metres, shape (n,).

        Parameters
        ----------
        configurations : ndarray of shape (n, 6)
            Positions of gripper A and gripper B.
        """
        first = 3 * GRIPPERS.index(self.gripper)
        return np.linalg.norm(configurations[:, first : first + 3] - self.position, axis=1)
