"""Biased RRT."""

from __future__ import annotations

import time
from typing import Any

from planners.batch_rrt import BatchRRT
from planners.biased_planner import BiasedPlanner, Found, Search
from planners.edge_checker import EdgeChecker
from planners.ompl_search import search_as_planner
from planners.result import PlanStatus
from planners.shortcutting import shorten
from planners.shortcutting_repropagated import Path, RepropagatedShortcuts
from systems.system import Array, System
from systems.validation import RandomState


class BiasedRRT(BiasedPlanner):
    """RRT that is biased away from transitions that an estimator distrusts.

    For every system: whatever a reduced state carries besides its configuration is propagated
    along the tree. Branches grow towards several samples at a time, one transition each per
    question to the estimator, until they arrive or a transition is rejected.

    Parameters
    ----------
    system : System
    estimator : estimator, default=None
        Any fitted classifier of ``system.features``; None plans without bias.
    k : float, default=1.0
        An Unreliable transition is accepted with the probability exp(-k * p_acc); np.inf rejects
        every one.
    accuracy : float, default=None
        p_acc, the estimator's accuracy on held-out data. None takes ``validation_accuracy_``.
    simplify : bool, default=True
        Take shortcuts of which every transition is classified Reliable.
    max_iterations : int, default=20000
        Samples to grow towards before giving up.
    time_limit : float, default=None
        Seconds to search before giving up. Only without it are results the same on every machine.
    random_state : int, Generator, RandomState, SeedSequence or None, default=None

    References
    ----------
    LaValle 1998; McConachie et al. 2020, Algorithm 1.

    Examples
    --------
    >>> from planners import BiasedRRT
    >>> from systems import PlanarArm
    >>> BiasedRRT(PlanarArm(), random_state=0).plan([-1.5, 0.0, 0.0], [1.5, 0.0, 0.0]).success
    True
    """

    def __init__(
        self,
        system: System,
        estimator: Any = None,
        *,
        k: float = 1.0,
        accuracy: float | None = None,
        simplify: bool = True,
        max_iterations: int = 20_000,
        time_limit: float | None = None,
        random_state: RandomState = None,
    ) -> None:
        self.system = system
        self.estimator = estimator
        self.k = k
        self.accuracy = accuracy
        self.simplify = simplify
        self.max_iterations = max_iterations
        self.time_limit = time_limit
        self.random_state = random_state

    def _search(self, search: Search) -> Found:
        rrt = BatchRRT(self.system, search.start, search.goals, search.check, search.rng)
        status, _ = search_as_planner(
            self.system.bounds,
            search.start[: self.system.configuration_dim],
            search.goals,
            rrt,
            budget=search.budget,
            seed=search.ompl_seed,
        )
        began = time.perf_counter()
        path, commands = rrt.path()
        if self.simplify and status is PlanStatus.SOLVED:
            path, commands = self._shortened(path, commands, search)
        return Found(
            status=status,
            reduced=path,
            commands=commands,
            tree=rrt.tree.edges(),
            simplification_time=time.perf_counter() - began,
        )

    def _shortened(self, path: Array, commands: Array, search: Search) -> tuple[Array, Array]:
        if self.system.configuration_dim < self.system.reduced_dim:
            shortcuts = RepropagatedShortcuts(self.system, search.goals, search.check, search.rng)
            shortened = shortcuts.shorten(Path(path, commands))
            return shortened.reduced, shortened.commands
        checker = EdgeChecker(self.system, search.check)
        shorter = shorten(path, checker, self.system, search.rng)
        return shorter, self.system.steer(shorter[:-1], shorter[1:])
