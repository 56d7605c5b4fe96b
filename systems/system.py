"""What a system is: a robot in one scene, with its reduced model and its true execution."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.validation import RandomState

Array = NDArray[np.float64]


class StopReason(Enum):
    """Why a rollout ended; each value reads as a sentence."""

    COMPLETED = "Every command was carried out."
    CONSTRAINT = "The system reached the boundary of a constraint and stopped there."
    GRIPPER_CONTACT = "A gripper would have touched an obstacle and stopped before it."
    OVERSTRETCHED = "The rope reached its largest allowed stretch and stopped there."


@dataclass(frozen=True)
class Problem:
    """A planning problem.

    Attributes
    ----------
    start : object
        True state x_0.
    goal : ndarray of shape (n_goals, configuration_dim)
        Configurations, any of which will do.
    """

    start: Any
    goal: Array


@dataclass(frozen=True)
class Rollout:
    """The execution of a sequence of commands.

    Attributes
    ----------
    states : sequence of states, or array with a state per row
        The start, one state per completed command, then the boundary state if it stopped.
    n_completed : int
        Commands that were carried out to their end.
    stop_reason : StopReason
    """

    states: Sequence[Any] | Array
    n_completed: int
    stop_reason: Enum


class System(ABC):
    """A robot in one scene E, seen three ways: truly, reduced, and as features.

    Subclass it to plan for a system of your own, and pass an instance to
    :func:`systems.check_system` to learn whether the planners can use it.

    A *reduced state* b is a float64 vector of length ``reduced_dim``. Its leading
    ``configuration_dim`` entries are the configuration q, in which planners sample, measure
    and steer; the rest is carried along by :meth:`propagate`. Methods that take reduced
    states take many of them, as rows. A system must pickle, and should start a simulator
    only when a rollout needs it.

    Attributes
    ----------
    reduced_dim : int
    configuration_dim : int
    step_size : float
        Largest change ‖q' − q‖ of one transition.
    bounds : ndarray of shape (2, configuration_dim)
        Lower and upper limits of the configurations that planners sample.
    angular : tuple of int, default=()
        Indices of the configuration's entries that are angles which wrap. They are in [-π, π),
        and planners measure and steer the short way round; so must ``steer`` and ``propagate``.
    independent_parts : tuple of slice, default=()
        Parts of the configuration that can move while the rest stands still, as either gripper
        of the rope. Planners also shorten the ways of one part alone.

    References
    ----------
    McConachie et al. 2020, "General Problem Formulation".
    """

    reduced_dim: int
    configuration_dim: int
    step_size: float
    bounds: Array
    angular: tuple[int, ...] = ()
    independent_parts: tuple[slice, ...] = ()

    @abstractmethod
    def reduce(self, state: Any) -> Array:
        """Reduce one true state: the paper's r.

        Returns
        -------
        reduced : ndarray of shape (reduced_dim,)
        """

    @abstractmethod
    def propagate(self, reduced: Array, command: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Predict one transition for each row: the paper's g.

        Parameters
        ----------
        reduced : ndarray of shape (n, reduced_dim)
        command : ndarray of shape (n, command_dim)

        Returns
        -------
        next_reduced : ndarray of shape (n, reduced_dim)
        valid : ndarray of bool of shape (n,)
            False where g has no successor, the paper's ∅.
        """

    @abstractmethod
    def steer(self, reduced: Array, configuration: Array) -> Array:
        """Return, for each row, the command of at most one step towards a configuration.

        Parameters
        ----------
        reduced : ndarray of shape (n, reduced_dim)
        configuration : ndarray of shape (n, configuration_dim)

        Returns
        -------
        command : ndarray of shape (n, command_dim)
        """

    @abstractmethod
    def rollout(self, state: Any, commands: Array) -> Rollout:
        """Execute commands in turn from a true state: the paper's Γ, repeated.

        The execution stops on the boundary of a constraint and never violates it.

        Parameters
        ----------
        state : object
        commands : ndarray of shape (T, command_dim)

        Raises
        ------
        SimulationDivergedError
            If the simulator diverged.
        """

    @abstractmethod
    def close(self, predicted: Array, executed: Array) -> NDArray[np.bool_]:
        """Say, row by row, whether two reduced states are meaningfully similar: Close.

        Parameters
        ----------
        predicted, executed : ndarray of shape (n, reduced_dim)

        Returns
        -------
        close : ndarray of bool of shape (n,)
        """

    @abstractmethod
    def features(self, reduced: Array, next_reduced: Array) -> NDArray[Any]:
        """Describe transitions in this scene to an estimator.

        Parameters
        ----------
        reduced, next_reduced : ndarray of shape (n, reduced_dim)

        Returns
        -------
        X : ndarray of shape (n, n_features)
        """

    @abstractmethod
    def sample_problem(self, random_state: RandomState = None) -> Problem:
        """Draw a start state and a goal."""

    def sample_configurations(self, rng: np.random.Generator, n: int) -> Array:
        """Draw configurations for :class:`planners.BiasedRRT` to grow towards.

        Uniform within ``bounds``; override it where few of those make sense.

        Parameters
        ----------
        rng : Generator
        n : int

        Returns
        -------
        configurations : ndarray of shape (n, configuration_dim)
        """
        low, high = self.bounds
        return rng.uniform(low, high, size=(n, len(low)))

    @abstractmethod
    def goal_reached(self, reduced: Array, goal: Array) -> NDArray[np.bool_]:
        """Say, row by row, whether a reduced state is a goal for the planner: Goal_B.

        Parameters
        ----------
        reduced : ndarray of shape (n, reduced_dim)
        goal : ndarray of shape (n_goals, configuration_dim)

        Returns
        -------
        reached : ndarray of bool of shape (n,)
        """

    @abstractmethod
    def succeeded(self, state: Any, goal: Array, tolerance: float) -> bool:
        """Say whether a true state is within ``tolerance`` of the goal: Goal_X."""
