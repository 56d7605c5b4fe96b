"""When a search has to stop."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from planners.result import PlanStatus
from systems.system import Array

# As many edges of one extension cost no iterations of their own, or fewer where fewer lead across
# the bounds.
MOST_FREE_EDGES = 1000


def free_edges(bounds: Array, longest_edge: float) -> int:
    """Return how many edges of one extension are part of its iteration.

    As many as a straight way from one corner of the bounds to the opposite one needs. Further ones
    cost an iteration each, so that an extension that never arrives ends with the budget.
    """
    needed = float(np.linalg.norm(bounds[1] - bounds[0])) / longest_edge
    return int(min(needed + 1, MOST_FREE_EDGES))


def never() -> bool:
    """Let a search go on."""
    return False


class Budget:
    """The iterations and the time that a search may use, counted from construction.

    Parameters
    ----------
    max_iterations : int
        Samples that the search may draw.
    time_limit : float or None
        Seconds that the search may take.
    terminated : callable, default=never
        Asked before each round of the search; it stops when the answer is True. OMPL's
        termination conditions are such callables.
    advanced : callable, default=None
        Told the number of iterations each time that some are used.

    Attributes
    ----------
    limit : PlanStatus
        Which limit was reached, once :meth:`exhausted` has returned True.
    """

    def __init__(
        self,
        max_iterations: int,
        time_limit: float | None = None,
        terminated: Callable[[], bool] = never,
        advanced: Callable[[int], None] | None = None,
    ) -> None:
        self._left = max_iterations
        self._deadline = np.inf if time_limit is None else time.perf_counter() + time_limit
        self._terminated = terminated
        self._advanced = advanced
        self.limit = PlanStatus.ITERATION_LIMIT

    def pay(self, n_edges: int = 1) -> bool:
        """Take an iteration for each edge that is not free; say whether that many were left."""
        self._left -= n_edges
        return self._left >= 0

    def exhausted(self, n_iterations: int = 1) -> bool:
        """Take iterations from the budget, or return True where it doesn't allow them."""
        if self._left < n_iterations:
            self.limit = PlanStatus.ITERATION_LIMIT
        elif time.perf_counter() > self._deadline:
            self.limit = PlanStatus.TIME_LIMIT
        elif self._terminated():
            self.limit = PlanStatus.TERMINATED
        else:
            self._left -= n_iterations
            if self._advanced is not None:
                self._advanced(n_iterations)
            return False
        return True
