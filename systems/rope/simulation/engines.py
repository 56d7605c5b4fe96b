"""The physics engines that can simulate the rope, and what they have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from systems.rope.obstacles.obstacle import Obstacle
from systems.rope.obstacles.shapes import Array
from systems.rope.simulation.mujoco_engine import MujocoRope
from systems.rope.simulation.pybullet_engine import PybulletRope
from systems.rope.simulation.state import RopeState


class RopeEngine(Protocol):
    """A rope in a physics engine, whose ends the grippers hold."""

    def load(self, state: RopeState) -> None:
        """Take over a state; one without ``simulation`` starts at rest."""

    def save(self) -> RopeState:
        """Return the present state."""

    def centre_line(self) -> Array:
        """Return points on the rope's centre line, which straight lines between them make up."""

    def move_grippers(self, grippers: Array) -> None:
        """Put the grippers, of shape (2, 3), where they are to be."""

    def step(self, n_steps: int) -> None:
        """Advance by some time steps."""


# Each is made from the obstacles, the number of nodes and their distance at rest, in metres.
ENGINES: dict[str, Callable[[Sequence[Obstacle], int, float], RopeEngine]] = {
    "mujoco": MujocoRope,
    "pybullet": PybulletRope,
}
