"""What the biased planners share: arguments, goals, and the making of results."""

from __future__ import annotations

import time
from abc import abstractmethod
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from threadpoolctl import threadpool_limits

from planners.check_transition import CheckTransition
from planners.ompl_search import Budget
from planners.result import PlanResult, PlanStatus
from systems.system import Array, System
from systems.validation import (
    RandomState,
    as_finite_array,
    as_seed,
    check_count,
    check_within_bounds,
)


@dataclass(frozen=True)
class Found:
    """What a search came to.

    Attributes
    ----------
    status : PlanStatus
    reduced : ndarray of shape (T + 1, reduced_dim)
    commands : ndarray of shape (T, command_dim)
    tree : ndarray of shape (n_edges, 2, configuration_dim)
    simplification_time : float
        Seconds of the search's duration that went into making the plan shorter.
    """

    status: PlanStatus
    reduced: Array
    commands: Array
    tree: Array
    simplification_time: float


@dataclass(frozen=True)
class Search:
    """One planning problem with what a search needs to solve it.

    Attributes
    ----------
    start : ndarray of shape (reduced_dim,)
    goals : ndarray of shape (n_goals, configuration_dim)
    check : CheckTransition
    budget : Budget
    rng : Generator
    ompl_seed : int
    """

    start: Array
    goals: Array
    check: CheckTransition
    budget: Budget
    rng: np.random.Generator
    ompl_seed: int


class BiasedPlanner(BaseEstimator):
    """Base of the biased planners; parameters are those of the planners.

    Constructors only store; :meth:`plan` validates.
    """

    system: System
    estimator: Any
    k: float
    accuracy: float | None
    simplify: bool
    max_iterations: int
    time_limit: float | None
    random_state: RandomState

    @abstractmethod
    def _search(self, search: Search) -> Found:
        """Solve a problem that has been checked."""

    def plan(self, start_reduced: ArrayLike, goal: ArrayLike) -> PlanResult:
        """Plan from a reduced state to a goal.

        Parameters
        ----------
        start_reduced : ndarray of shape (reduced_dim,)
        goal : ndarray of shape (n_goals, configuration_dim) or (configuration_dim,)
            Configurations, any of which will do. Goals at which the estimator distrusts even
            standing still are set aside; if it distrusts all, the most reliable one is kept.

        Returns
        -------
        PlanResult

        Raises
        ------
        ValueError
            If a parameter, the start, the goal or the estimator is unfit.
        sklearn.exceptions.NotFittedError
            If the estimator is not fitted.
        """
        began = time.perf_counter()
        self._check_parameters()
        seed = as_seed(self.random_state)
        for_search, for_ompl = np.random.SeedSequence(seed).spawn(2)
        rng = np.random.default_rng(for_search)
        check = CheckTransition(
            self.system, self.estimator, k=self.k, accuracy=self.accuracy, rng=rng
        )
        start = self._checked_start(start_reduced)
        goals = self._trusted_goals(self._checked_goals(goal), check)
        # OMPL ignores a seed of zero.
        ompl_seed = 1 + int(for_ompl.generate_state(1)[0])
        budget = Budget(int(self.max_iterations), self.time_limit)
        with _one_thread(check):
            found = self._search(Search(start, goals, check, budget, rng, ompl_seed))
        duration = time.perf_counter() - began
        return PlanResult(
            reduced=found.reduced,
            commands=found.commands,
            status=found.status,
            reliability=self._reliability(found, check),
            planning_time=duration - found.simplification_time,
            simplification_time=found.simplification_time,
            n_checked=check.n_checked,
            n_rejected=check.n_rejected,
            n_accepted_unreliable=check.n_accepted_unreliable,
            tree=found.tree,
            random_state=seed,
        )

    def _reliability(self, found: Found, check: CheckTransition) -> Array | None:
        if self.estimator is None:
            return None
        return check.probability(found.reduced[:-1], found.reduced[1:])

    def _check_parameters(self) -> None:
        if not isinstance(self.system, System):
            raise ValueError(f"system must be a System, got {self.system!r}.")
        check_count(self.max_iterations, "max_iterations")
        limit = self.time_limit
        if limit is not None and not (isinstance(limit, int | float) and limit > 0):
            raise ValueError(f"time_limit must be None or positive seconds, got {limit!r}.")

    def _checked_start(self, start_reduced: ArrayLike) -> Array:
        start = as_finite_array(start_reduced, "start_reduced", (self.system.reduced_dim,))
        configuration = start[: self.system.configuration_dim]
        check_within_bounds(configuration, self.system.bounds, "start_reduced")
        if not self._can_stay(start[None])[0]:
            raise ValueError(
                f"start_reduced must be a state from which propagate is valid, got {start}."
            )
        return start

    def _checked_goals(self, goal: ArrayLike) -> Array:
        dim = self.system.configuration_dim
        goals = as_finite_array(np.atleast_2d(goal), "goal", (None, dim))
        if len(goals) == 0:
            raise ValueError("goal must hold at least one configuration, got none.")
        check_within_bounds(goals, self.system.bounds, "goal")
        if dim < self.system.reduced_dim:
            return goals
        possible = self._can_stay(goals)
        if not possible.any():
            raise ValueError(
                f"goal must hold a configuration that can be reached: propagate is not valid at "
                f"any of the {len(goals)}, such as {goals[0]}."
            )
        return goals[possible]

    def _can_stay(self, reduced: Array) -> NDArray[np.bool_]:
        """Say, row by row, whether g allows the transition that goes nowhere."""
        command = self.system.steer(reduced, reduced[:, : self.system.configuration_dim])
        return self.system.propagate(reduced, command)[1]

    def _trusted_goals(self, goals: Array, check: CheckTransition) -> Array:
        if len(goals) == 1 or self.estimator is None or goals.shape[1] < self.system.reduced_dim:
            return goals
        trusted = check.classify(goals, goals)
        if trusted.any():
            return goals[trusted]
        return goals[[int(np.argmax(check.probability(goals, goals)))]]


def _one_thread(check: CheckTransition) -> AbstractContextManager[Any]:
    """Keep an estimator from sharing out its rows: of a few, threads mostly wait."""
    return nullcontext() if check.answers_fast else threadpool_limits(1, user_api="openmp")
