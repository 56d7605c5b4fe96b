"""The biased planners as planners of OMPL: see ``docs/ompl.md``."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from ompl import base as ob
from ompl import geometric as og

from planners.result import PlanResult
from systems.angles import wrap_columns
from systems.system import Array, System
from systems.validation import as_finite_array

# Samples of a goal region that is not a list of states.
REGION_SAMPLES = 100
# The start state may have been rounded on its way through OMPL.
SAME_START = 1e-9


class OmplPlanner(ob.Planner):
    """A biased planner that solves the problems of OMPL's ``SimpleSetup`` and ``Benchmark``.

    Made by ``ompl_planner`` of :class:`planners.BiasedRRT` and
    :class:`planners.BiasedRRTConnect`. Start and goal states come from OMPL's problem definition,
    g and the bounds from the system. The search ends at OMPL's termination condition, or at the
    planner's own ``max_iterations`` or ``time_limit``, whichever comes first. Each solve begins a
    new tree.

    Parameters
    ----------
    space_information : ompl.base.SpaceInformation
    planner : BiasedRRT or BiasedRRTConnect
        Parameters are read from it at each solve.
    start_reduced : ndarray of shape (reduced_dim,) or None

    Attributes
    ----------
    result : PlanResult or None
        What the last solve came to; None before the first one and after ``clear``.

    Raises
    ------
    ValueError
        If the state space doesn't fit the system, or ``start_reduced`` is missing or unfit.
    """

    def __init__(
        self, space_information: Any, planner: Any, start_reduced: ArrayLike | None
    ) -> None:
        if not isinstance(space_information, ob.SpaceInformation):
            raise ValueError(
                f"space_information must be OMPL's SpaceInformation, got {space_information!r}."
            )
        super().__init__(space_information, type(planner).__name__)
        self.result: PlanResult | None = None
        self._graph: _Graph | None = None
        self._planner = planner
        self._start_reduced = _checked_start(planner.system, start_reduced)
        _check_space(space_information, planner.system)
        # OMPL copies the argument of an overridden getPlannerData, which aborts the process. Once
        # its own method has been called, OMPL no longer looks for an overriding one; from Python
        # the attribute comes first.
        ob.Planner.getPlannerData(self, ob.PlannerData(space_information))
        self.getPlannerData = self._fill_planner_data

    def get_params(self) -> dict[str, Any]:
        """Return the planner's parameters by name."""
        return dict(self._planner.get_params(deep=False))

    def set_params(self, **parameters: Any) -> OmplPlanner:
        """Set parameters of the planner, for the next solve."""
        self._planner.set_params(**parameters)
        return self

    def solve(self, termination: Any) -> Any:
        """Solve OMPL's problem and add the path to its problem definition.

        Parameters
        ----------
        termination : ompl.base.PlannerTerminationCondition
            Asked before each round of the search.

        Returns
        -------
        ompl.base.PlannerStatus
            ``EXACT_SOLUTION``, ``TIMEOUT``, ``INVALID_START``, ``INVALID_GOAL`` or, for a goal
            that can't be sampled, ``UNRECOGNIZED_GOAL_TYPE``. ``ABORT`` for a plan less likely to
            go well than ``min_success``, which is in ``result`` alone.

        Raises
        ------
        ValueError
            As :meth:`planners.BiasedRRT.plan`.
        """
        self.checkValidity()
        self.getPlannerInputStates().restart()
        if not isinstance(self.getProblemDefinition().getGoal(), ob.GoalSampleableRegion):
            return ob.PlannerStatus(ob.PlannerStatus.UNRECOGNIZED_GOAL_TYPE)
        starts, goals = self._starts(), self._goals()
        if len(starts) == 0:
            return ob.PlannerStatus(ob.PlannerStatus.INVALID_START)
        if len(goals) == 0:
            return ob.PlannerStatus(ob.PlannerStatus.INVALID_GOAL)
        self.result = self._planner.plan_from_any(starts, goals, termination)
        self._graph = _graph(self.result, starts, goals)
        if not self.result.solved:
            return ob.PlannerStatus(ob.PlannerStatus.TIMEOUT)
        if not self.result.success:
            return ob.PlannerStatus(ob.PlannerStatus.ABORT)
        self._add_solution(self.result)
        return ob.PlannerStatus(ob.PlannerStatus.EXACT_SOLUTION)

    def clear(self) -> None:
        """Forget the last solve."""
        super().clear()
        self.result = self._graph = None

    def _starts(self) -> Array:
        """Read the reduced states to start from."""
        system, states = self._planner.system, self.getPlannerInputStates()
        starts = [self._configuration(state) for state in iter(states.nextStart, None)]
        if self._start_reduced is None or not starts:
            return np.array(starts)
        gap = np.abs(np.array(starts) - self._start_reduced[: system.configuration_dim])
        if gap.max() > SAME_START:
            raise ValueError(
                "start_reduced must be the reduced state at OMPL's start state "
                f"{starts[0].tolist()}, got the configuration "
                f"{self._start_reduced[: system.configuration_dim].tolist()}."
            )
        return self._start_reduced[None]

    def _goals(self) -> Array:
        """Read the goal's states, or sample its region."""
        states, goal = self.getPlannerInputStates(), self.getProblemDefinition().getGoal()
        n = goal.maxSampleCount()
        if not isinstance(goal, ob.GoalState | ob.GoalStates):
            n = min(n, REGION_SAMPLES)
        goals = []
        while states.getSampledGoalsCount() < n:
            # None for a state that OMPL finds invalid or out of bounds.
            state = states.nextGoal()
            if state is not None:
                goals.append(self._configuration(state))
        return np.array(goals)

    def _configuration(self, state: Any) -> Array:
        space = self.getSpaceInformation().getStateSpace()
        n = self._planner.system.configuration_dim
        values = np.array([space.getValueAddressAtIndex(state, i) for i in range(n)])
        return wrap_columns(values, self._planner.system.angular)

    def _states(self, reduced: Array) -> list[Any]:
        """Make OMPL states of the leading columns of an array, row by row."""
        information = self.getSpaceInformation()
        # Values can't be written before the space is set up.
        if not information.isSetup():
            information.setup()
        space, n = information.getStateSpace(), self._planner.system.configuration_dim
        states = [information.allocState() for _ in reduced]
        for state, row in zip(states, reduced, strict=True):
            space.copyFromReals(state, row[:n].tolist())
        return states

    def _add_solution(self, result: PlanResult) -> None:
        path = og.PathGeometric(self.getSpaceInformation())
        for state in self._states(result.reduced):
            path.append(state)
        self.getProblemDefinition().addSolutionPath(path, False, 0.0, self.getName())

    def _fill_planner_data(self, data: Any) -> None:
        """Add the last solve's tree; nodes of the same configuration are one vertex."""
        if self._graph is None:
            return
        states = self._states(self._graph.configurations)
        add = {"start": data.addStartVertex, "goal": data.addGoalVertex, "": data.addVertex}
        vertices = [
            add[role](ob.PlannerDataVertex(state))
            for state, role in zip(states, self._graph.roles, strict=True)
        ]
        for parent, child in self._graph.edges:
            data.addEdge(vertices[parent], vertices[child])
        # The data refers to our states, and needs copies before these are freed.
        data.decoupleFromPlanner()
        del states


class _Graph(NamedTuple):
    """A search tree as vertices and edges.

    Attributes
    ----------
    configurations : ndarray of shape (n_vertices, configuration_dim)
    roles : list of str
        "start", "goal" or "" for each vertex.
    edges : ndarray of int of shape (n_edges, 2)
        Vertices that each edge leads from and to, in the direction of execution.
    """

    configurations: Array
    roles: list[str]
    edges: NDArray[np.int64]


def _graph(result: PlanResult, starts: Array, goals: Array) -> _Graph:
    dim = goals.shape[1]
    starts = starts[:, :dim]
    if result.solved:
        goals = np.concatenate([goals, result.reduced[-1:, :dim]])
    rows = np.concatenate([starts, result.tree.reshape(-1, dim)])
    vertices, vertex_of = np.unique(rows, axis=0, return_inverse=True)
    starting, ending = _rows_of(starts), _rows_of(goals)
    roles = [
        "start" if row in starting else "goal" if row in ending else ""
        for row in map(tuple, vertices.tolist())
    ]
    return _Graph(vertices, roles, vertex_of.reshape(-1)[len(starts) :].reshape(-1, 2))


def _rows_of(array: Array) -> set[tuple[float, ...]]:
    return {tuple(row) for row in array.tolist()}


def _check_space(space_information: Any, system: System) -> None:
    space, n = space_information.getStateSpace(), system.configuration_dim
    state = space_information.allocState()
    # None where the state has no such number.
    has_all = space.getValueAddressAtIndex(state, n - 1) is not None
    if not has_all or space.getValueAddressAtIndex(state, n) is not None:
        raise ValueError(
            f"space_information must be of a state space of {n} numbers, the configuration of "
            f"{type(system).__name__}, got {space.getName()} of dimension {space.getDimension()}."
        )


def _checked_start(system: System, start_reduced: ArrayLike | None) -> Array | None:
    if start_reduced is not None:
        return as_finite_array(start_reduced, "start_reduced", (system.reduced_dim,))
    if system.reduced_dim > system.configuration_dim:
        raise ValueError(
            f"start_reduced must be given, since a reduced state of {type(system).__name__} is "
            "more than the configuration that OMPL's start state holds, got None."
        )
    return None
