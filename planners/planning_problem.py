"""What is to be planned, checked before a search begins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planners.check_transition import CheckTransition
from systems.system import Array, System
from systems.validation import as_finite_array, check_within_bounds


@dataclass(frozen=True)
class PlanningProblem:
    """A system, the states to start from and the configurations to reach.

    Attributes
    ----------
    system : System
    starts : ndarray of shape (n_starts, reduced_dim)
        Reduced states; a plan begins at any one of them.
    goals : ndarray of shape (n_goals, configuration_dim)
        Configurations; a plan ends at any one of them.
    """

    system: System
    starts: Array
    goals: Array

    @classmethod
    def checked(
        cls, system: System, starts: Sequence[ArrayLike], goals: ArrayLike
    ) -> PlanningProblem:
        """Make a problem of a user's starts and goals.

        Goals that g forbids are left out, as long as one remains. Whether it does is only known
        where the reduced state is nothing but a configuration.

        Raises
        ------
        ValueError
            If a start or goal has the wrong shape, is not finite or is out of bounds, if g allows
            no transition from a start, or if no goal can be reached.
        """
        return cls(system, _checked_starts(system, starts), _checked_goals(system, goals))

    def with_trusted_goals(self, check: CheckTransition) -> PlanningProblem:
        """Leave out goals at which the estimator calls even standing still Unreliable.

        If it does so at all of them, the one that is most probably Reliable is kept.
        """
        if len(self.goals) == 1 or not _only_configuration(self.system):
            return self
        trusted = check.classify(self.goals, self.goals)
        if not trusted.any():
            trusted[np.argmax(check.probability(self.goals, self.goals))] = True
        return replace(self, goals=self.goals[trusted])


def _checked_starts(system: System, starts: Sequence[ArrayLike]) -> Array:
    shape = (system.reduced_dim,)
    checked = np.array([as_finite_array(start, "start_reduced", shape) for start in starts])
    check_within_bounds(checked[:, : system.configuration_dim], system.bounds, "start_reduced")
    blocked = ~_can_stay(system, checked)
    if blocked.any():
        raise ValueError(
            "start_reduced must be a state from which propagate is valid, "
            f"got {checked[blocked][0]}."
        )
    return checked


def can_start(system: System, reduced: Array) -> bool:
    """Say whether planning may begin at a reduced state: it is in bounds, and g can stay there."""
    configuration, (low, high) = reduced[: system.configuration_dim], system.bounds
    within = bool(((configuration >= low) & (configuration <= high)).all())
    return within and bool(_can_stay(system, reduced[None])[0])


def _checked_goals(system: System, goals: ArrayLike) -> Array:
    checked = as_finite_array(np.atleast_2d(goals), "goal", (None, system.configuration_dim))
    if len(checked) == 0:
        raise ValueError("goal must hold at least one configuration, got none.")
    check_within_bounds(checked, system.bounds, "goal")
    if not _only_configuration(system):
        return checked
    possible = _can_stay(system, checked)
    if not possible.any():
        raise ValueError(
            "goal must hold a configuration that can be reached: propagate is not valid at "
            f"any of the {len(checked)}, such as {checked[0]}."
        )
    return checked[possible]


def _only_configuration(system: System) -> bool:
    return system.reduced_dim == system.configuration_dim


def _can_stay(system: System, reduced: Array) -> NDArray[np.bool_]:
    """Say, row by row, whether g allows the transition that goes nowhere."""
    command = system.steer(reduced, reduced[:, : system.configuration_dim])
    return system.propagate(reduced, command)[1]
