"""What a viewer asks a system for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from systems.drawing.shapes import Shape

Array = NDArray[np.float64]


class Drawable:
    """The part of a system that says how it looks; all of it is optional.

    A system that defines :meth:`draw` can be shown by :func:`planners.show`. The other methods add
    to the picture. All return plain data, metres in the world frame with z up: see
    ``docs/viewer.md``.

    Attributes
    ----------
    view_from : tuple of float, default=(-0.6, -1.6, 1.0)
        The direction, as seen from the scene, in which the camera stands at first.
    """

    view_from: ClassVar[tuple[float, float, float]] = (-0.6, -1.6, 1.0)

    def draw(self, reduced: Array) -> Sequence[Shape]:
        """Return how the system looks in a reduced state.

        Parameters
        ----------
        reduced : ndarray of shape (reduced_dim,)

        Returns
        -------
        shapes : sequence of SphereShape, BoxShape, CylinderShape, TubeShape or MeshShape
            In the same order in each state, so that a viewer can move them.

        Raises
        ------
        NotImplementedError
            If the system does not say how it looks.
        """
        raise NotImplementedError(
            f"{type(self).__name__} does not say how it looks. Give it a method draw(reduced) that "
            "returns a list of shapes (systems.SphereShape, BoxShape, CylinderShape, TubeShape, "
            "MeshShape), and best also draw_scene and traced_points; docs/viewer.md shows how."
        )

    def draw_state(self, state: Any) -> Sequence[Shape]:
        """Return how the system looks in a true state: by default, as in its reduced state.

        Override it where the true state has what the reduced one leaves out.

        Parameters
        ----------
        state : object

        Returns
        -------
        shapes : sequence of shapes
        """
        return self.draw(self.reduce(state))  # type: ignore[attr-defined]

    def draw_scene(self) -> Sequence[Shape]:
        """Return what stands around the system and does not move; nothing by default."""
        return ()

    def draw_goal(self, configuration: Array) -> Sequence[Shape]:
        """Return how a goal looks, beside balls at its traced points; nothing by default.

        Parameters
        ----------
        configuration : ndarray of shape (configuration_dim,)

        Returns
        -------
        shapes : sequence of shapes
        """
        return ()

    def traced_points(self, configurations: Array) -> Array:
        """Return the points whose paths stand for the motion, such as the tip of an arm.

        Paths of plans and executions, search trees and goals are drawn by these points. By
        default there are none, and only the system itself is drawn.

        Parameters
        ----------
        configurations : ndarray of shape (n, configuration_dim)

        Returns
        -------
        points : ndarray of shape (n, n_points, 3)
        """
        return np.empty((len(configurations), 0, 3))

    def states_between(self, state: Any, command: Array) -> Sequence[Any] | Array:
        """Return true states on the way of one command, at equal times.

        By default there are none, and between two states of a rollout shapes move straight.
        Override it where they don't, as with a car, whose commands are long and lead around bends.

        Parameters
        ----------
        state : object
            In which the command begins.
        command : ndarray of shape (command_dim,)

        Returns
        -------
        states : sequence of states
            With or without the first; the last one is where the command ended.
        """
        return ()
