"""Goals that are more than a list of configurations."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class GoalRegion(ABC):
    """A set of configurations, from which planners draw goals when they need them.

    For goals that a list of configurations could only tile: all that put a gripper on an object,
    anywhere behind a line. Subclass it, and give it as the goal of a :class:`systems.Problem` or
    to ``plan``. Planners draw configurations from it with their own random state, more and more of
    them as the search goes on, and leave out those that are not finite, out of the system's
    bounds, where ``propagate`` is not valid even for standing still, or where the estimator calls
    standing still Unreliable. A plan ends at one of them.

    A region must pickle, as must the system whose problems have it.

    References
    ----------
    ``GoalSampleableRegion`` of OMPL, which also has to say how to draw from a goal and how far a
    state is from it.

    Examples
    --------
    >>> import numpy as np
    >>> from planners import BiasedRRTConnect
    >>> from systems import GoalRegion, PlanarArm
    >>> class Raised(GoalRegion):
    ...     "The arm is straight, between 45° and 135°; any other angle of the first joint is less."
    ...     def sample(self, rng, n):
    ...         return np.column_stack([rng.uniform(0.25, 0.75, n) * np.pi, np.zeros((n, 2))])
    ...     def distance(self, configurations):
    ...         too_far = np.maximum(abs(configurations[:, 0] - np.pi / 2) - np.pi / 4, 0)
    ...         return np.linalg.norm(np.column_stack([too_far, configurations[:, 1:]]), axis=1)
    >>> plan = BiasedRRTConnect(PlanarArm(), random_state=0).plan([-1.5, 0.0, 0.0], Raised())
    >>> bool(Raised().distance(plan.reduced[-1:])[0] < 1e-9)
    True
    """

    def __repr__(self) -> str:
        return f"<{type(self).__name__}, a region of goals>"

    @abstractmethod
    def sample(self, rng: np.random.Generator, n: int) -> Array:
        """Draw configurations of the region, all that is random from ``rng``.

        Parameters
        ----------
        rng : Generator
        n : int

        Returns
        -------
        configurations : ndarray of shape (m, configuration_dim)
            n of them; fewer, or none, where some draws came to nothing.
        """

    @abstractmethod
    def distance(self, configurations: Array) -> Array:
        """Say how far configurations are from the region, in the system's units; 0 inside it.

        Where the goal is a region, this says whether an execution succeeded: the configuration of
        the true state, reduced, is at most the tolerance away.

        Parameters
        ----------
        configurations : ndarray of shape (n, configuration_dim)

        Returns
        -------
        distance : ndarray of shape (n,)
        """
