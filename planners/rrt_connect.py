"""Biased RRT-Connect."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from planners.batch_rrt_connect import BatchRRTConnect
from planners.biased_planner import BiasedPlanner, Found, Search
from planners.edge_checker import EdgeChecker
from planners.edge_discretization import split_edges
from planners.ompl_search import rrt_connect, search_as_planner
from planners.result import PlanStatus
from planners.shortcutting import shorten
from systems.system import Array, System
from systems.validation import RandomState, check_count


class BiasedRRTConnect(BiasedPlanner):
    """RRT-Connect that is biased away from transitions that an estimator distrusts.

    For systems whose reduced state is only a configuration, and which can be steered exactly from
    one configuration to another. OMPL's own RRT-Connect searches when the estimator answers
    quickly for single transitions; for all other estimators, and for configurations with angles
    that wrap, one that asks about the edges of several extensions at a time.

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
    transitions_per_edge : int, default=5
        Longest edge of the trees, in transitions. An edge is added only if every one of its
        transitions is accepted, so the longer the edges, the stronger the bias at the same k.
    simplify : bool, default=True
        Take shortcuts of which every transition is classified Reliable.
    max_iterations : int, default=20000
        Samples to draw before giving up.
    time_limit : float, default=None
        Seconds to search before giving up. Only without it are results the same on every machine.
    random_state : int, Generator, RandomState, SeedSequence or None, default=None

    References
    ----------
    Kuffner and LaValle 2000; McConachie et al. 2020, Algorithm 1.

    Examples
    --------
    >>> from planners import BiasedRRTConnect
    >>> from systems import PlanarArm
    >>> planner = BiasedRRTConnect(PlanarArm(), random_state=0)
    >>> planner.plan([-1.5, 0.0, 0.0], [1.5, 0.0, 0.0]).success
    True
    """

    def __init__(
        self,
        system: System,
        estimator: Any = None,
        *,
        k: float = 1.0,
        accuracy: float | None = None,
        transitions_per_edge: int = 5,
        simplify: bool = True,
        max_iterations: int = 20_000,
        time_limit: float | None = None,
        random_state: RandomState = None,
    ) -> None:
        self.system = system
        self.estimator = estimator
        self.k = k
        self.accuracy = accuracy
        self.transitions_per_edge = transitions_per_edge
        self.simplify = simplify
        self.max_iterations = max_iterations
        self.time_limit = time_limit
        self.random_state = random_state

    def _check_parameters(self) -> None:
        super()._check_parameters()
        check_count(self.transitions_per_edge, "transitions_per_edge")
        if self.system.configuration_dim != self.system.reduced_dim:
            raise ValueError(
                "BiasedRRTConnect needs a system whose reduced state is only a configuration, "
                f"and {type(self.system).__name__} carries "
                f"{self.system.reduced_dim - self.system.configuration_dim} more numbers along; "
                "use BiasedRRT."
            )

    def _search(self, search: Search) -> Found:
        checker = EdgeChecker(self.system, search.check)
        status, vertices = self._vertices(search, checker)
        if vertices is None:
            path, simplification_time = search.start[None], 0.0
        else:
            path = _transition_states(vertices, self.system)
            began = time.perf_counter()
            if self.simplify:
                path = shorten(path, checker, self.system, search.rng)
            simplification_time = time.perf_counter() - began
        return Found(
            status=status,
            reduced=path,
            commands=self.system.steer(path[:-1], path[1:]),
            tree=checker.accepted_edges(),
            simplification_time=simplification_time,
        )

    def _vertices(self, search: Search, checker: EdgeChecker) -> tuple[PlanStatus, Array | None]:
        problem = (self.system.bounds, search.start, search.goals)
        longest_edge = self.transitions_per_edge * self.system.step_size
        # OMPL adds up the distances of a compound space where we want the Euclidean one.
        if search.check.answers_fast and not self.system.angular:
            return rrt_connect(
                *problem,
                checker,
                longest_edge=longest_edge,
                budget=search.budget,
                seed=search.ompl_seed,
            )
        batch = BatchRRTConnect(*problem, checker, longest_edge, self.system.angular, search.rng)
        return search_as_planner(*problem, batch, budget=search.budget, seed=search.ompl_seed)


def _transition_states(vertices: Array, system: System) -> Array:
    """Return the states along a path's edges, cut as they were when they were checked."""
    origins, targets, _ = split_edges(vertices[:-1], vertices[1:], system.step_size, system.angular)
    return np.concatenate([origins[:1], targets])
