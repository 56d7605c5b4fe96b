"""A system's pictures, after checking that they can be shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from systems.drawing.shapes import Shape
from systems.errors import SystemContractError
from systems.goal_region import GoalRegion
from systems.system import Array, System

_N_OF_REGION = 40


@dataclass(frozen=True)
class DrawnSystem:
    """A system as a viewer asks it: what is no picture raises an error that names the method."""

    system: System

    def reduced(self, reduced: Array) -> list[Shape]:
        """Return the shapes of a reduced state."""
        return self._shapes("draw", self.system.draw(reduced))

    def state(self, state: Any) -> list[Shape]:
        """Return the shapes of a true state."""
        return self._shapes("draw_state", self.system.draw_state(state))

    def scene(self) -> list[Shape]:
        """Return the shapes of what does not move."""
        return self._shapes("draw_scene", self.system.draw_scene())

    def goals(self, goal: Array | GoalRegion | None) -> tuple[list[Shape], Array]:
        """Return the shapes of goals, and their traced points, (n, 3)."""
        if goal is None:
            return [], np.empty((0, 3))
        if isinstance(goal, GoalRegion):
            drawn = goal.sample(np.random.default_rng(0), _N_OF_REGION)
            return [], self.points(drawn).reshape(-1, 3)
        shapes = [
            shape for row in goal for shape in self._shapes("draw_goal", self.system.draw_goal(row))
        ]
        return shapes, self.points(goal).reshape(-1, 3)

    def points(self, configurations: Array) -> Array:
        """Return the traced points of configurations, or of reduced states, (n, n_points, 3)."""
        rows = configurations[:, : self.system.configuration_dim]
        points = np.asarray(self.system.traced_points(rows), dtype=np.float64)
        fits = points.ndim == 3 and len(points) == len(rows) and points.shape[2] == 3
        if not fits or not np.isfinite(points).all():
            raise SystemContractError(
                f"{type(self.system).__name__}.traced_points must return finite numbers of shape "
                f"(n, n_points, 3), here n = {len(rows)}, got an array of shape {points.shape}."
            )
        return points

    def _shapes(self, method: str, shapes: Any) -> list[Shape]:
        if not isinstance(shapes, Sequence) or not all(isinstance(s, Shape) for s in shapes):
            raise SystemContractError(
                f"{type(self.system).__name__}.{method} must return a sequence of shapes "
                "(systems.SphereShape, BoxShape, CylinderShape, TubeShape or MeshShape), got "
                f"{shapes!r}."
            )
        return list(shapes)
