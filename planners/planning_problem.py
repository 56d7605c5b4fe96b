"""What is to be planned, checked before a search begins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from planners.check_transition import CheckTransition
from planners.goals import BATCH, MOST_BATCHES, GoalSampler, possible_goals, trusted
from planners.standing_still import can_stay
from systems.angles import wrap_columns
from systems.goal_region import GoalRegion
from systems.system import Array, System
from systems.validation import as_finite_array, is_number

MOST_GOALS = 1000


@dataclass
class PlanningProblem:
    """A system, the states to start from and the configurations to reach.

    Attributes
    ----------
    system : System
    starts : ndarray of shape (n_starts, reduced_dim)
        Reduced states; a plan begins at any one of them.
    goals : ndarray of shape (n_goals, configuration_dim)
        Configurations; a plan ends at any one of them. Of a region, those drawn so far.
    sampler : GoalSampler or None, default=None
        Draws further goals where the goal is a region.
    """

    system: System
    starts: Array
    goals: Array
    sampler: GoalSampler | None = None

    @classmethod
    def checked(
        cls,
        system: System,
        starts: Sequence[ArrayLike],
        goal: ArrayLike | GoalRegion,
        rng: np.random.Generator,
    ) -> PlanningProblem:
        """Make a problem of a user's starts and goals; bring their angles to [-π, π).

        Starts may lie out of bounds, which limit where planners sample: a system that has come
        there has to be planned for. Goals that are not finite, out of bounds or forbidden by g are
        left out, as long as one remains. Whether g forbids one is only known where the reduced
        state is nothing but a configuration.

        Raises
        ------
        ValueError
            If a start or goal has the wrong shape, if a start is not finite or farther outside
            the bounds than these are wide, if g allows no transition from a start, or if no goal
            can be reached.
        """
        at = _checked_starts(system, starts)
        if not isinstance(goal, GoalRegion):
            return cls(system, at, possible_goals(system, goal))
        sampler = GoalSampler(system, goal, rng)
        return cls(system, at, sampler.first(at), sampler)

    def with_trusted_goals(self, check: CheckTransition) -> PlanningProblem:
        """Leave out goals at which the estimator calls even standing still Unreliable.

        If it does so at all of them, the one that is most probably Reliable is kept; of a region,
        after many were drawn.
        """
        if self.sampler is not None:
            return self._with_trusted_sampler(self.sampler, check)
        if len(self.goals) == 1:
            return self
        return replace(self, goals=_most_trusted(self.system, self.goals, check))

    def draw_goals(self, n: int) -> Array:
        """Add at most n further goals of a region to ``goals``, and return them.

        None where the goal is not a region, or where more goals would only slow the search down.
        """
        if self.sampler is None or len(self.goals) >= MOST_GOALS:
            return self.goals[:0]
        drawn = self.sampler.draw(n)
        self.goals = np.concatenate([self.goals, drawn])
        return drawn

    def _with_trusted_sampler(
        self, sampler: GoalSampler, check: CheckTransition
    ) -> PlanningProblem:
        goals = self.goals
        for _ in range(MOST_BATCHES):
            if trusted(self.system, goals, check).any():
                break
            goals = np.concatenate([goals, sampler.draw(BATCH)])
        most_trusted = _most_trusted(self.system, goals, check)
        return replace(self, goals=most_trusted, sampler=replace(sampler, check=check))


def check_space(system: System) -> None:
    """Raise ``ValueError`` unless a system's bounds and step size are such that a search ends."""
    name, step, bounds = type(system).__name__, system.step_size, system.bounds
    if not is_number(step) or not 0 < step < np.inf:
        raise ValueError(f"{name}.step_size must be a positive number, got {step!r}.")
    if not isinstance(bounds, np.ndarray):
        raise ValueError(f"{name}.bounds must be a numpy array, got {bounds!r}.")
    low, high = as_finite_array(bounds, f"{name}.bounds", (2, system.configuration_dim))
    if (low > high).any():
        raise ValueError(f"{name}.bounds must be lower limits, then upper ones, got {bounds!r}.")
    farthest = float(np.abs(bounds).max())
    if farthest + step == farthest:
        raise ValueError(
            f"{name}.step_size must be large enough to lead anywhere: {farthest!r} + {step!r}, "
            "at the end of the bounds, is the same number again."
        )


def can_start(system: System, reduced: Array) -> bool:
    """Say whether planning may begin at a reduced state: where g allows standing still.

    It may lie out of the system's bounds, but no farther than these are wide.
    """
    if not np.isfinite(reduced).all():
        return False
    start = wrap_columns(reduced[None], system.angular)
    return not _is_too_far(system, start[0]) and bool(can_stay(system, start)[0])


def _checked_starts(system: System, starts: Sequence[ArrayLike]) -> Array:
    shape = (system.reduced_dim,)
    checked = np.array([as_finite_array(start, "start_reduced", shape) for start in starts])
    checked = wrap_columns(checked, system.angular)
    for start in checked:
        if _is_too_far(system, start):
            low, high = system.bounds.tolist()
            raise ValueError(
                f"start_reduced must lie near the bounds {low} to {high}, no farther outside than "
                f"they are wide, got {start[: system.configuration_dim].tolist()}. Is it in the "
                "system's units?"
            )
    blocked = ~can_stay(system, checked)
    if blocked.any():
        raise ValueError(
            "start_reduced must be a state from which propagate is valid, "
            f"got {checked[blocked][0]}."
        )
    return checked


def _is_too_far(system: System, start: Array) -> bool:
    configuration, (low, high) = start[: system.configuration_dim], system.bounds
    beyond = np.maximum(low - configuration, configuration - high)
    beyond[list(system.angular)] = 0
    return bool((beyond > high - low).any())


def _most_trusted(system: System, goals: Array, check: CheckTransition) -> Array:
    """Return the goals that are trusted, or the one that comes nearest to it."""
    kept = trusted(system, goals, check)
    if not kept.any():
        kept[np.argmax(check.probability(goals, goals))] = True
    return goals[kept]
