"""What the biased planners share: parameters, and the way from a problem to a result."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted
from threadpoolctl import threadpool_limits

from planners.acceptance import ACCEPTANCES, resolve_accuracy, warn_if_permissive
from planners.budget import Budget, never
from planners.check_transition import CheckTransition
from planners.edge_checker import EdgeChecker
from planners.path import Path
from planners.plan_robustness import plan_robustness
from planners.plan_turning import plan_turning
from planners.planning_problem import PlanningProblem, check_space
from planners.progress import Progress
from planners.restarts import best_until_enough
from planners.result import PlanResult, PlanStatus
from planners.search import Found, Search
from planners.shortcutting import shorten
from planners.shortcutting_repropagated import RepropagatedShortcuts
from planners.success_calibration import SuccessCalibration
from reliability.documentation_link import DocumentationLink
from systems.goal_region import GoalRegion
from systems.system import System
from systems.validation import (
    RandomState,
    as_seed,
    check_choice,
    check_count,
    check_flag,
    check_number,
    check_verbose,
    is_integer,
    is_number,
)

# No restart has this number, so that none has these random numbers.
_FOR_ROBUSTNESS = (2**32 - 1,)


@dataclass(eq=False, repr=False)
class BiasedPlanner(DocumentationLink, BaseEstimator):
    """Base of the biased planners, which document the parameters.

    Constructors only store; :meth:`plan` validates.
    """

    system: System
    estimator: Any = None
    _: KW_ONLY
    k: float = 1.0
    accuracy: float | None = None
    acceptance: str = "fixed"
    simplify: bool = True
    max_iterations: int = 20_000
    time_limit: float | None = None
    calibration: SuccessCalibration | None = None
    min_success: float = 0.0
    restarts: int = 0
    random_state: RandomState = None
    verbose: int = 0

    @abstractmethod
    def _search(self, search: Search) -> Found:
        """Look for a path from a start to a goal."""

    def plan(self, start_reduced: ArrayLike, goal: ArrayLike | GoalRegion) -> PlanResult:
        """Plan from a reduced state to a goal.

        Parameters
        ----------
        start_reduced : ndarray of shape (reduced_dim,)
            May lie out of the system's bounds, which limit where planners sample, but no farther
            than these are wide; ``propagate`` has to be valid for standing still there. Angles
            are brought to [-π, π), as those of the goal are.
        goal : GoalRegion, or ndarray of shape (n_goals, configuration_dim) or (configuration_dim,)
            Configurations, any of which will do, or a region to draw them from. Those that are
            not finite, out of bounds, or where ``propagate`` is not valid for standing still are
            left out, as long as others remain. So are those at which the estimator calls even
            standing still Unreliable; if it does so at all of them, the one that is most probably
            Reliable is kept.

        Returns
        -------
        PlanResult

        Raises
        ------
        ValueError
            If a parameter, the start, the goal or the estimator is unfit.
        sklearn.exceptions.NotFittedError
            If the estimator or the calibration is not fitted.
        """
        return self.plan_from_any([start_reduced], goal)

    def plan_from_any(
        self,
        starts_reduced: Sequence[ArrayLike],
        goal: ArrayLike | GoalRegion,
        terminated: Callable[[], bool] = never,
    ) -> PlanResult:
        """Plan from any of several reduced states, until told to stop.

        Parameters
        ----------
        starts_reduced : sequence of ndarray of shape (reduced_dim,)
        goal : GoalRegion, or ndarray of shape (n_goals, configuration_dim) or (configuration_dim,)
            As in :meth:`plan`.
        terminated : callable, default=never
            Asked before each round of the search, which stops when the answer is True.

        Returns
        -------
        PlanResult
        """
        self._check_parameters()
        if self.estimator is not None and self.acceptance == "fixed":
            p_acc = resolve_accuracy(self.estimator, self.accuracy)
            check_number(self.k, "k", 0, np.inf)
            # Shown at the line that calls plan.
            warn_if_permissive(self.k, p_acc, stacklevel=3)
        attempts = self._attempts(starts_reduced, goal, terminated)
        # Any plan would be good enough for 0, which asks for nothing.
        enough = self.min_success if self.min_success > 0 else 1.0
        best = best_until_enough(attempts, enough, lambda plan: plan.success_probability)
        return self._judged(best)

    def _attempts(
        self,
        starts: Sequence[ArrayLike],
        goal: ArrayLike | GoalRegion,
        terminated: Callable[[], bool],
    ) -> Iterator[PlanResult]:
        """Plan with one seed after another, until nothing is left of the time."""
        seed, limit = as_seed(self.random_state), self.time_limit
        for number in range(1 + int(self.restarts)):
            began = time.perf_counter()
            plan = self._plan_once(_restart_seed(seed, number), limit, starts, goal, terminated)
            yield replace(plan, random_state=seed)
            if plan.status in (PlanStatus.TIME_LIMIT, PlanStatus.TERMINATED):
                return
            if limit is not None:
                # Preparing a search takes its time too.
                taken = time.perf_counter() - began - plan.simplification_time
                limit = max(0.0, limit - taken)
                if limit == 0:
                    return

    def _plan_once(
        self,
        seed: int,
        time_limit: float | None,
        starts: Sequence[ArrayLike],
        goal: ArrayLike | GoalRegion,
        terminated: Callable[[], bool],
    ) -> PlanResult:
        began = time.perf_counter()
        progress = Progress(type(self).__name__, bool(self.verbose))
        advanced = progress.advance if self.verbose else None
        budget = Budget(int(self.max_iterations), time_limit, terminated, advanced)
        search = self._build(seed, starts, goal, budget)
        with _one_thread(search.check):
            with progress.searching(search.check, int(self.max_iterations)):
                found = self._search(search)
            searched = time.perf_counter()
            progress.searched(found.path, search.check, searched - began)
            path = self._shortened(found, search)
            robustness = self._robustness(path, seed)
        times = searched - began, time.perf_counter() - searched
        report = self._report(search, found, path, times, seed)
        plan = self._calibrated(replace(report, robustness=robustness))
        progress.planned(plan)
        return plan

    def _robustness(self, path: Path | None, seed: int) -> float | None:
        if path is None or self.estimator is None:
            return None
        sequence = np.random.SeedSequence(seed, spawn_key=_FOR_ROBUSTNESS)
        return plan_robustness(self.system, path, np.random.default_rng(sequence))

    def _calibrated(self, plan: PlanResult) -> PlanResult:
        if self.calibration is None or not plan.solved:
            return plan
        probability = float(self.calibration.predict_proba([plan])[0, 1])
        return replace(plan, calibrated_probability=probability)

    def _judged(self, plan: PlanResult) -> PlanResult:
        if plan.solved and plan.success_probability < self.min_success:
            return replace(plan, status=PlanStatus.DISTRUSTED)
        return plan

    def ompl_planner(self, space_information: Any, start_reduced: ArrayLike | None = None) -> Any:
        """Make an OMPL planner of this one, for a problem that is set up in OMPL.

        It reads this planner's parameters whenever it solves, and returns the path of
        :meth:`plan`. See ``docs/ompl.md``.

        Parameters
        ----------
        space_information : ompl.base.SpaceInformation
            Of a state space whose numbers are the system's configuration.
        start_reduced : ndarray of shape (reduced_dim,), default=None
            The reduced state at OMPL's start state. Needed where a reduced state is more than a
            configuration, as the rope's is.

        Returns
        -------
        planners.ompl_planner.OmplPlanner
            An ``ompl.base.Planner``.

        Raises
        ------
        ValueError
            If the state space doesn't fit the system, or ``start_reduced`` is missing or unfit.
        """
        from planners.ompl_planner import OmplPlanner

        self._check_parameters()
        return OmplPlanner(space_information, self, start_reduced)

    def _check_parameters(self) -> None:
        if not isinstance(self.system, System):
            raise ValueError(f"system must be a System, got {self.system!r}.")
        check_space(self.system)
        check_choice(self.acceptance, "acceptance", ACCEPTANCES)
        check_flag(self.simplify, "simplify")
        check_count(self.max_iterations, "max_iterations")
        limit = self.time_limit
        if limit is not None and not (is_number(limit) and limit > 0):
            raise ValueError(f"time_limit must be None or positive seconds, got {limit!r}.")
        if not is_integer(self.restarts) or self.restarts < 0:
            raise ValueError(f"restarts must be 0 or a positive integer, got {self.restarts!r}.")
        check_verbose(self.verbose)
        self._check_trust()

    def _check_trust(self) -> None:
        check_number(self.min_success, "min_success", 0, 1)
        calibration = self.calibration
        if calibration is not None and not isinstance(calibration, SuccessCalibration):
            raise ValueError(
                f"calibration must be None or a SuccessCalibration, got {calibration!r}."
            )
        if self.estimator is None and (calibration is not None or self.min_success > 0):
            raise ValueError(
                "calibration and min_success need an estimator: without one nothing is known of "
                "how likely a plan is to go well. Pass estimator, or leave both out."
            )
        if calibration is not None:
            check_is_fitted(calibration)

    def _build(
        self,
        seed: int,
        starts: Sequence[ArrayLike],
        goal: ArrayLike | GoalRegion,
        budget: Budget,
    ) -> Search:
        for_search, for_ompl = np.random.SeedSequence(seed).spawn(2)
        rng = np.random.default_rng(for_search)
        check = CheckTransition(
            self.system,
            self.estimator,
            k=self.k,
            accuracy=self.accuracy,
            rng=rng,
            acceptance=self.acceptance,
        )
        problem = PlanningProblem.checked(self.system, starts, goal, rng)
        problem = problem.with_trusted_goals(check)
        # OMPL ignores a seed of zero.
        return Search(problem, check, budget, rng, 1 + int(for_ompl.generate_state(1)[0]))

    def _shortened(self, found: Found, search: Search) -> Path | None:
        if found.path is None or not self.simplify:
            return found.path
        problem, check, rng = search.problem, search.check, search.rng
        if self.system.configuration_dim < self.system.reduced_dim:
            return RepropagatedShortcuts(problem, check, rng).shorten(found.path)
        checker = EdgeChecker(self.system, check)
        reduced = shorten(found.path.reduced, checker, self.system, rng)
        return Path(reduced, self.system.steer(reduced[:-1], reduced[1:]))

    def _report(
        self,
        search: Search,
        found: Found,
        path: Path | None,
        times: tuple[float, float],
        seed: int,
    ) -> PlanResult:
        check = search.check
        solved = path is not None
        reduced, commands = path or _standing(search.problem)
        no_estimator = self.estimator is None
        return PlanResult(
            reduced=reduced,
            commands=commands,
            status=PlanStatus.SOLVED if solved else search.budget.limit,
            reliability=None if no_estimator else check.probability(reduced[:-1], reduced[1:]),
            planning_time=times[0],
            simplification_time=times[1],
            n_checked=check.n_checked,
            n_rejected=check.n_rejected,
            n_accepted_unreliable=check.n_accepted_unreliable,
            tree=found.tree,
            random_state=seed,
            turning=plan_turning(self.system, reduced),
        )


def _restart_seed(seed: int, number: int) -> int:
    """Return the seed of a restart; the first attempt, number 0, has the planner's own."""
    if number == 0:
        return seed
    # The first two children of the seed's sequence are those of the search.
    sequence = np.random.SeedSequence(seed, spawn_key=(1 + number,))
    return int(sequence.generate_state(1, np.uint64)[0])


def _standing(problem: PlanningProblem) -> Path:
    """Return the path that stays at the first start: one state and no command."""
    start = problem.starts[:1]
    configuration = start[:, : problem.system.configuration_dim]
    return Path(start, problem.system.steer(start, configuration)[:0])


def _one_thread(check: CheckTransition) -> AbstractContextManager[Any]:
    """Keep an estimator from sharing few rows among threads, which then mostly wait."""
    return nullcontext() if check.answers_fast else threadpool_limits(1, user_api="openmp")
