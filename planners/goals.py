"""Goals: a user's configurations judged one by one, and those drawn from a region."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planners.check_transition import CheckTransition
from planners.standing_still import can_stay, is_only_configuration
from systems.angles import wrap_columns
from systems.goal_region import GoalRegion
from systems.system import Array, Problem, System
from systems.validation import as_array

# Draws of a region before giving up, and at a time.
MOST_BATCHES = 40
BATCH = 16
_MOST_TOLD = 5


def possible_goals(system: System, goal: ArrayLike) -> Array:
    """Return the goals that a plan may end at, their angles in [-π, π).

    Those are finite and within bounds, and g allows standing still at them. The last is only known
    where the reduced state is nothing but a configuration.

    Parameters
    ----------
    system : System
    goal : array-like of shape (n_goals, configuration_dim) or (configuration_dim,)

    Returns
    -------
    goals : ndarray of shape (n_possible, configuration_dim)

    Raises
    ------
    ValueError
        If ``goal`` has another shape, or if none of the goals will do; it says what is wrong with
        each.
    """
    goals = as_array(np.atleast_2d(goal), "goal", (None, system.configuration_dim))
    if len(goals) == 0:
        raise ValueError("goal must hold at least one configuration, got none.")
    goals = _wrapped(system, goals)
    faults = _Faults.of(system, goals)
    if not faults.none.any():
        raise ValueError(_complaint(system, goals, faults))
    return goals[faults.none]


@dataclass(frozen=True)
class GoalSampler:
    """Draws goals from a region.

    Attributes
    ----------
    system : System
    region : GoalRegion
    rng : Generator
    check : CheckTransition or None, default=None
        Where given, goals at which it calls standing still Unreliable are left out.
    """

    system: System
    region: GoalRegion
    rng: np.random.Generator
    check: CheckTransition | None = None

    def draw(self, n: int) -> Array:
        """Draw n configurations, and return those that a plan may end at."""
        goals = self._sampled(n)
        goals = goals[_Faults.of(self.system, goals).none]
        return goals if self.check is None else goals[trusted(self.system, goals, self.check)]

    def first(self, starts: Array) -> Array:
        """Draw until there are some goals.

        Of reduced states to start from, (n, reduced_dim), those that lie in the region are taken
        instead: from there, nothing is left to do.

        Raises
        ------
        ValueError
            If the region gives nothing that a plan may end at; says what was wrong.
        """
        places = starts[:, : self.system.configuration_dim]
        inside = places[distance_to(self.region, places) <= 0]
        if len(inside):
            return inside
        for _ in range(MOST_BATCHES):
            goals = self.draw(BATCH)
            if len(goals):
                return goals
        raise ValueError(
            f"goal must be a region of which a plan can reach something; none of "
            f"{MOST_BATCHES * BATCH} draws from {self.region!r} will do. {self._last_draws()}"
        )

    def _last_draws(self) -> str:
        goals = self._sampled(BATCH)
        if len(goals) == 0:
            return "Its sample returned no configuration."
        return f"The last are: {_complaint(self.system, goals, _Faults.of(self.system, goals))}"

    def _sampled(self, n: int) -> Array:
        drawn = self.region.sample(self.rng, n)
        name = f"{type(self.region).__name__}.sample"
        if n == 0 or (isinstance(drawn, list) and not drawn):
            return np.empty((0, self.system.configuration_dim))
        goals = as_array(drawn, name, (None, self.system.configuration_dim))
        return _wrapped(self.system, goals[:n])


def has_succeeded(system: System, problem: Problem, state: object, tolerance: float) -> bool:
    """Say whether a true state is within a tolerance of a problem's goal, a region or not."""
    if not isinstance(problem.goal, GoalRegion):
        return bool(system.succeeded(state, problem.goal, tolerance))
    configuration = system.reduce(state)[None, : system.configuration_dim]
    return bool(distance_to(problem.goal, configuration)[0] <= tolerance)


def distance_to(region: GoalRegion, configurations: Array) -> Array:
    """Return how far configurations are from a region, after checking what it says."""
    name = f"{type(region).__name__}.distance"
    distances = as_array(region.distance(configurations), name, (len(configurations),))
    if np.isnan(distances).any():
        raise ValueError(f"{name} must return numbers, got NaN.")
    return distances


def trusted(system: System, goals: Array, check: CheckTransition) -> NDArray[np.bool_]:
    """Say at which goals the estimator calls standing still Reliable.

    At all of them where a reduced state is more than a configuration, since that is not known.
    """
    if not is_only_configuration(system) or len(goals) == 0:
        return np.ones(len(goals), dtype=np.bool_)
    return check.classify(goals, goals)


def _wrapped(system: System, goals: Array) -> Array:
    """Bring the angles of goals that are finite to [-π, π)."""
    finite, wrapped = np.isfinite(goals).all(axis=1), np.array(goals)
    wrapped[finite] = wrap_columns(goals[finite], system.angular)
    return wrapped


@dataclass(frozen=True)
class _Faults:
    """What is wrong with each goal: the first of these that holds, or nothing."""

    infinite: NDArray[np.bool_]
    outside: NDArray[np.bool_]
    blocked: NDArray[np.bool_]

    @classmethod
    def of(cls, system: System, goals: Array) -> _Faults:
        low, high = system.bounds
        infinite = np.asarray(~np.isfinite(goals).all(axis=1))
        outside = np.asarray(~infinite & ((goals < low) | (goals > high)).any(axis=1))
        blocked = np.zeros(len(goals), dtype=np.bool_)
        rest = ~(infinite | outside)
        if is_only_configuration(system) and rest.any():
            blocked[rest] = ~can_stay(system, goals[rest])
        return cls(infinite, outside, blocked)

    @property
    def none(self) -> NDArray[np.bool_]:
        return ~(self.infinite | self.outside | self.blocked)


def _complaint(system: System, goals: Array, faults: _Faults) -> str:
    """Say what is wrong with goals none of which will do."""
    low, high = system.bounds.tolist()
    within = f"must lie within the bounds {low} to {high}"
    demands = np.where(
        faults.infinite,
        "must be finite",
        np.where(faults.outside, within, "must be a configuration at which propagate is valid"),
    )
    if len(goals) == 1:
        return f"goal {demands[0]}, got {goals[0].tolist()}."
    told = [
        f"goal[{i}] {demands[i]}, got {goals[i].tolist()}"
        for i in range(min(len(goals), _MOST_TOLD))
    ]
    more = [f"{len(goals) - _MOST_TOLD} more"] if len(goals) > _MOST_TOLD else []
    return f"goal must hold a configuration that can be reached: {'; '.join(told + more)}."
