"""The interface of a system: a robot in one scene, with a reduced model and a true execution."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.drawing.drawable import Drawable
from systems.features.default import default_features
from systems.features.names import DefaultFeatureNames
from systems.goal_region import GoalRegion
from systems.reprs import shortened
from systems.validation import RandomState

Array = NDArray[np.float64]


class StopReason(Enum):
    """Why a rollout ended; each value is a sentence.

    A system whose rollouts can end for several reasons tells them apart with an enum of its own,
    whose values are sentences too.
    """

    COMPLETED = "Every command was carried out."
    CONSTRAINT = "The system reached the boundary of a constraint and stopped there."


@dataclass(frozen=True)
class Problem:
    """A start and a goal.

    Attributes
    ----------
    start : object
        A true state, the paper's x_0.
    goal : ndarray of shape (n_goals, configuration_dim), or GoalRegion
        Goal configurations, of which a plan has to reach one, or a region to draw them from.
    """

    start: Any
    goal: Array | GoalRegion

    def __repr__(self) -> str:
        return f"Problem(start={shortened(self.start)}, goal={shortened(self.goal)})"


@dataclass(frozen=True)
class Rollout:
    """The execution of a sequence of commands.

    Attributes
    ----------
    states : sequence of states, or array with a state per row
        The start, the state after each completed command and, if the execution stopped at the
        boundary of a constraint, the state there.
    n_completed : int
        How many commands were carried out to their end.
    stop_reason : Enum
        ``StopReason.COMPLETED`` if, and only if, every command was carried out; otherwise
        ``StopReason.CONSTRAINT`` or a member of the system's own enum, whose value is a sentence.
    """

    states: Sequence[Any] | Array
    n_completed: int
    stop_reason: Enum

    def __repr__(self) -> str:
        return (
            f"Rollout({len(self.states)} states, {self.n_completed} commands completed, "
            f"{self.stop_reason.name})"
        )


class System(Drawable, ABC):
    """A robot in one scene (the paper's environment E): its true execution and a reduced model.

    Subclass it to plan for a system of your own, and pass an instance to
    :func:`systems.check_system`, which raises if planners could not use it.

    A *reduced state* b is a float64 vector of length ``reduced_dim``. Its first
    ``configuration_dim`` entries are the *configuration* q: planners sample configurations,
    measure distances between them and steer from one to another. The other entries follow from
    :meth:`propagate` alone.

    *Rows.* Methods that take reduced states take an array with one per row, and answer row by row:
    what a row gives must not depend on the others. Zero rows are asked about as well, and must be
    answered with zero rows.

    *Repeatable.* :meth:`reduce`, :meth:`propagate`, :meth:`steer`, :meth:`close`, :meth:`features`
    and :meth:`rollout` must give the same for the same arguments, and leave these as they are. A
    simulator must not remember what it did before; noise of the true system has to follow from the
    state. What :meth:`sample_problem` and :meth:`sample_configurations` draw must follow from the
    generator that they are given. Data are collected with one seed for each plan, and
    :func:`planners.evaluate` and :func:`reliability.learn_in_rounds` have seeds of their own, so
    that the same ``random_state`` gives each of them other problems.

    *Units and frames* are the system's own, as long as all methods agree. Distances between
    configurations are Euclidean, so that an entry in radians counts as much as one in metres: scale
    what should count more or less. A tolerance is in the same units.

    *Simulators and pickling.* A system must pickle, since data are collected in other processes
    (``n_jobs``). Leave simulators out of ``__getstate__``, and all else in it; start or connect one
    when a rollout first needs it, not in ``__init__``. Threads need one each.
    ``examples/own_simulator.py`` is a template.

    *Pictures.* A system that also defines :meth:`draw` can be looked at in motion, with
    :func:`planners.show`; ``docs/viewer.md`` shows how.

    Attributes
    ----------
    reduced_dim : int
    configuration_dim : int
    step_size : float
        The largest distance ‖q' − q‖ that one transition may cover.
    bounds : ndarray of shape (2, configuration_dim)
        Lower limits (first row) and upper limits of the configurations that planners sample, and
        of goals. A plan may begin out of them, where the system has come to be: what is possible
        there is up to :meth:`propagate`.
    angular : tuple of int, default=()
        Indices of the entries of a configuration that are angles, for which -π and π are the same.
        They lie in [-π, π), and planners measure the shorter way around the circle between two
        of them. ``steer`` must go that way, and ``propagate`` must return angles in [-π, π).
    independent_parts : tuple of slice, default=()
        Parts of the configuration that can move while the others stand still, such as each of the
        rope's two grippers. Planners then also shorten the path of one part at a time.
    feature_names_out : sequence of str of length n_features, or None
        What the columns of :meth:`features` are called, all of them different, for tables and
        messages. None, the default of a system with features of its own, if nothing is said. An
        estimator that was fitted on some of these columns, or in another order, is given those.

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
    feature_names_out: Sequence[str] | None = DefaultFeatureNames()  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: reduced_dim {getattr(self, 'reduced_dim', 'unknown')}>"

    @abstractmethod
    def reduce(self, state: Any) -> Array:
        """Return the reduced state of one true state: the paper's r.

        Parameters
        ----------
        state : object
            A start, or any state that a rollout returns.

        Returns
        -------
        reduced : ndarray of shape (reduced_dim,)
            Angles, if any, in [-π, π).
        """

    @abstractmethod
    def propagate(self, reduced: Array, command: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Predict one transition for each row: the paper's g.

        Parameters
        ----------
        reduced : ndarray of shape (n, reduced_dim)
        command : ndarray of shape (n, command_dim)
            As :meth:`steer` returns them.

        Returns
        -------
        next_reduced : ndarray of shape (n, reduced_dim)
        valid : ndarray of bool of shape (n,)
            False where g has no successor (the paper's ∅); what ``next_reduced`` holds in such a
            row does not matter. Planners take a start, and a goal of a system whose reduced state
            is only a configuration, where standing still is valid: the command of
            ``steer(reduced, configuration of reduced)``.
        """

    @abstractmethod
    def steer(self, reduced: Array, configuration: Array) -> Array:
        """Return, for each row, the command that moves one step towards a configuration.

        A step covers ``step_size``, or less if the configuration is nearer; then
        :meth:`propagate` must arrive at it exactly. Only the system itself reads a command. It may
        be an increment to go by, a target to go to, or whatever else :meth:`propagate` and
        :meth:`rollout` understand. If commands are targets, one that is carried out from elsewhere
        than planned still leads to its target; increments then miss by what went wrong before.

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
        """Execute commands one after the other from a true state: the paper's Γ, repeated.

        The execution stops at the boundary of a constraint and never violates it. The same state
        and commands must always give the same rollout, in each process, and a rollout that goes on
        from a returned state should go on as if there had been no stop: a true state holds all that
        matters, such as velocities.

        Parameters
        ----------
        state : object
        commands : ndarray of shape (T, command_dim)
            T may be 0.

        Returns
        -------
        Rollout

        Raises
        ------
        SimulationDivergedError
            If the simulator diverged.
        """

    @abstractmethod
    def close(self, predicted: Array, executed: Array) -> NDArray[np.bool_]:
        """Say for each row whether the two reduced states are similar: the paper's Close.

        A transition is labelled Reliable if what g predicts is close to what was executed. So
        they are close if the rest of a plan would do for the one as well as for the other. That is
        a judgement about the system, and sets how much an estimator can promise: too wide, and
        plans of Reliable transitions fail; too narrow, and hardly a transition is Reliable. Every
        state is close to itself.

        Parameters
        ----------
        predicted, executed : ndarray of shape (n, reduced_dim)

        Returns
        -------
        close : ndarray of bool of shape (n,)
        """

    def features(self, reduced: Array, next_reduced: Array) -> NDArray[Any]:
        """Return what an estimator sees of transitions in this scene.

        By default, where a transition starts and how it moves: the configuration, from -1 to 1
        within ``bounds``, angles as sine and cosine instead; the rest of the reduced state as it
        is; and the change of the configuration (angles the shorter way round) and of the rest,
        over ``step_size``. Override this to say what the reduced model ignores, such as how
        near obstacles are; docs/features.md shows how.

        Parameters
        ----------
        reduced, next_reduced : ndarray of shape (n, reduced_dim)

        Returns
        -------
        X : ndarray of shape (n, n_features)
            Whatever matters of the scene has to be in these numbers.
        """
        return default_features(
            reduced, next_reduced, self.bounds, self.angular, float(self.step_size)
        )

    @abstractmethod
    def sample_problem(self, random_state: RandomState = None) -> Problem:
        """Draw a start state and a goal.

        Parameters
        ----------
        random_state : None, int, SeedSequence, Generator or RandomState
            The same integer gives the same problem.

        Returns
        -------
        Problem
            Planners refuse a start at which g does not even allow standing still. Of goals they
            leave out those at which it doesn't, and refuse a problem that has no other.
        """

    def sample_configurations(self, rng: np.random.Generator, n: int) -> Array:
        """Draw the configurations that :class:`planners.BiasedRRT` grows its tree towards.

        They are uniform within ``bounds``; override this where few of those make sense.

        Parameters
        ----------
        rng : Generator
        n : int

        Returns
        -------
        configurations : ndarray of shape (n, configuration_dim)
            Within the bounds.
        """
        low, high = self.bounds
        return rng.uniform(low, high, size=(n, len(low)))

    def vary(self, rng: np.random.Generator) -> System | None:
        """Draw a system whose reduced model errs a little differently, to predict plans with.

        Override it where small errors can have large effects: a ball on a ridge, or a rope whose
        slack lies on the head of a peg and may slide off to either side. Planners then predict
        each finished plan with several variants, and trust it the less the more of them end
        elsewhere; see :func:`planners.plan_robustness.plan_robustness`.

        Vary what is not known exactly, such as a friction, a wind or a centre of mass, and vary it
        as far as it may be wrong. A plan that goes well should go well in nearly all variants.

        Parameters
        ----------
        rng : Generator

        Returns
        -------
        variant : System or None
            Most easily a copy with other parameters; planners ask only its ``propagate``, and its
            ``close`` once at the end. None, the default, if there is nothing to vary: planners
            then leave this out.
        """
        return None

    @abstractmethod
    def goal_reached(self, reduced: Array, goal: Array) -> NDArray[np.bool_]:
        """Say for each row whether a reduced state is at the goal: the paper's Goal_B.

        Parameters
        ----------
        reduced : ndarray of shape (n, reduced_dim)
        goal : ndarray of shape (n_goals, configuration_dim)
            Of a :class:`systems.GoalRegion`, the configurations that were drawn from it so far.

        Returns
        -------
        reached : ndarray of bool of shape (n,)
            True at any one of the goals; allow for rounding.
        """

    @abstractmethod
    def succeeded(self, state: Any, goal: Array, tolerance: float) -> bool:
        """Say whether a true state is within a tolerance of the goal: the paper's Goal_X.

        Parameters
        ----------
        state : object
        goal : ndarray of shape (n_goals, configuration_dim)
            Never a :class:`systems.GoalRegion`, which is asked for its ``distance`` instead.
        tolerance : float
            In the units of the configuration; every state is within ``np.inf``.
        """
