"""The region of goals at which one gripper is at its place and the other one is free."""

from __future__ import annotations

import numpy as np

from systems.goal_region import GoalRegion
from systems.rope.gripper_goal import GRIPPERS, GripperGoal
from systems.rope.obstacles.shapes import Array
from systems.rope.sampling import clear_pairs
from systems.rope.scene import Scene


class GripperGoalRegion(GoalRegion):
    """Where one gripper is at its place, in a scene.

    The other one is drawn uniformly from the clear space that the rope reaches.

    Parameters
    ----------
    goal : GripperGoal
    scene : Scene
    """

    def __init__(self, goal: GripperGoal, scene: Scene) -> None:
        self.goal = goal
        self.scene = scene

    def __repr__(self) -> str:
        place = np.round(self.goal.position, 3).tolist()
        return f"<GripperGoalRegion: gripper {self.goal.gripper} at {place}>"

    def sample(self, rng: np.random.Generator, n: int) -> Array:
        """Draw at most n pairs of gripper positions, shape (m, 6)."""
        place, reach = np.array(self.goal.position), self.scene.max_band_length
        low = np.maximum(self.scene.bounds[0], place - reach)
        high = np.minimum(self.scene.bounds[1], place + reach)
        pairs = np.tile(place, (n, 2))
        other = 3 * (1 - GRIPPERS.index(self.goal.gripper))
        pairs[:, other : other + 3] = rng.uniform(low, high, size=(n, 3))
        return pairs[clear_pairs(self.scene, pairs, reach)]

    def distance(self, configurations: Array) -> Array:
        """Return how far the gripper is from its place, metres, shape (n,)."""
        return self.goal.distance(configurations)
