"""RRT that propagates whole reduced states and grows towards several samples at a time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planners.budget import Budget, free_edges
from planners.check_transition import CheckTransition
from planners.path import Path
from planners.planning_problem import PlanningProblem
from planners.search_tree import SearchTree
from systems.angles import shortest_way
from systems.system import Array
from systems.validation import MOST

EXTENSIONS_PER_ROUND = 8
GOAL_BIAS = 0.1
# A share of the step: adding a displacement to a configuration rounds.
ARRIVED = 1e-9
# A straight extension takes at most as many steps as the bounds' diagonal has.
LONGEST_EXTENSION = 10


class BatchRRT:
    """An RRT with several extensions under way, which ask the estimator together.

    An extension leads from a node of the tree towards a target. Each round adds one transition to
    every extension; an extension ends when it reaches its target or a transition is rejected, and
    another one takes its place. Most start at the node that is nearest to a random sample. A tenth
    start where an extension towards a sample has just ended, and lead towards a goal: if they
    started at the node nearest to the goal, they would fail again and again at the same place.

    Parameters
    ----------
    problem : PlanningProblem
    check : CheckTransition
    rng : Generator

    Attributes
    ----------
    tree : SearchTree
    """

    def __init__(
        self, problem: PlanningProblem, check: CheckTransition, rng: np.random.Generator
    ) -> None:
        system = problem.system
        self.tree = SearchTree(problem.starts, system.configuration_dim, system.angular)
        self._system = system
        self._problem = problem
        self._check = check
        self._rng = rng
        # The command that led to each node; none does to a root, whose entry is never read.
        configurations = problem.starts[:, : system.configuration_dim]
        self._commands = [system.steer(problem.starts, configurations)]
        self._tried_goal: set[int] = set()
        diagonal = float(np.linalg.norm(system.bounds[1] - system.bounds[0]))
        self._most_steps = int(min(LONGEST_EXTENSION * diagonal / system.step_size, MOST))
        self._free_steps = free_edges(system.bounds, system.step_size)

    def grow(self, budget: Budget) -> Path | None:
        """Grow the tree until a node is a goal; return the path to it, or None without one."""
        at_goal = self._first_at_goal(np.arange(len(self.tree.reduced)))
        none = np.arange(0)
        extensions, ended = _Extensions(self._problem.goals[:0], none, none == 0, none), none
        while at_goal is None:
            n_idle = EXTENSIONS_PER_ROUND - len(extensions.nodes)
            if budget.exhausted(n_idle):
                return None
            extensions = _joined(extensions, self._started(n_idle, ended))
            added, extensions, ended = self._extended(extensions)
            budget.pay(int((extensions.n_steps > self._free_steps).sum()))
            at_goal = self._first_at_goal(added)
        nodes = self.tree.path_from_root(at_goal)
        return Path(self.tree.reduced[nodes], np.concatenate(self._commands)[nodes[1:]])

    def _first_at_goal(self, nodes: NDArray[np.int64]) -> int | None:
        reached = self._system.goal_reached(self.tree.reduced[nodes], self._problem.goals)
        return int(nodes[np.argmax(reached)]) if reached.any() else None

    def _started(self, n: int, ended: NDArray[np.int64]) -> _Extensions:
        """Start extensions, some of them towards a goal from nodes where others have ended."""
        fresh = np.array([node for node in ended if node not in self._tried_goal], dtype=np.int64)
        to_goal = fresh[self._rng.random(len(fresh)) < GOAL_BIAS]
        self._tried_goal.update(to_goal.tolist())
        self._problem.draw_goals(len(to_goal))
        goals = self._problem.goals
        goals = goals[self._rng.integers(len(goals), size=len(to_goal))]
        samples = self._system.sample_configurations(self._rng, n - len(to_goal))
        return _Extensions(
            targets=np.concatenate([goals, samples]),
            nodes=np.concatenate([to_goal, self.tree.nearest(samples)]),
            to_goal=np.arange(n) < len(to_goal),
            n_steps=np.zeros(n, dtype=np.int64),
        )

    def _extended(
        self, extensions: _Extensions
    ) -> tuple[NDArray[np.int64], _Extensions, NDArray[np.int64]]:
        """Add one transition to each extension.

        Returns
        -------
        added : ndarray of int
            The new nodes.
        going_on : _Extensions
            The extensions that have neither reached their target nor been rejected.
        ended : ndarray of int
            The nodes at which extensions towards samples have ended.
        """
        system, targets, dim = self._system, extensions.targets, self._system.configuration_dim
        reduced = self.tree.reduced[extensions.nodes]
        command = system.steer(reduced, targets)
        following, valid = system.propagate(reduced, command)
        moved = (following[:, :dim] != reduced[:, :dim]).any(axis=1)
        possible = np.flatnonzero(valid & moved)
        accepted = possible[self._check(reduced[possible], following[possible])]
        added = self.tree.add(following[accepted], extensions.nodes[accepted])
        self._commands.append(command[accepted])

        nodes, n_steps = extensions.nodes.copy(), extensions.n_steps + 1
        nodes[accepted] = added
        left = shortest_way(following[accepted, :dim], targets[accepted], system.angular)
        goes_on = np.zeros(len(nodes), dtype=np.bool_)
        goes_on[accepted] = (np.abs(left) > ARRIVED * system.step_size).any(axis=1)
        goes_on &= n_steps < self._most_steps
        extended = extensions._replace(nodes=nodes, n_steps=n_steps)
        return added, _selected(extended, goes_on), nodes[~goes_on & ~extensions.to_goal]


class _Extensions(NamedTuple):
    """Extensions under way, one row each.

    Attributes
    ----------
    targets : ndarray of shape (n, configuration_dim)
    nodes : ndarray of int of shape (n,)
        The node that each has got to.
    to_goal : ndarray of bool of shape (n,)
        Whether the target is a goal.
    n_steps : ndarray of int of shape (n,)
        Transitions taken so far. A ``steer`` that never arrives must not extend for ever.
    """

    targets: Array
    nodes: NDArray[np.int64]
    to_goal: NDArray[np.bool_]
    n_steps: NDArray[np.int64]


def _selected(extensions: _Extensions, rows: NDArray[np.bool_]) -> _Extensions:
    return _Extensions._make(column[rows] for column in extensions)


def _joined(one: _Extensions, other: _Extensions) -> _Extensions:
    return _Extensions._make(np.concatenate(columns) for columns in zip(one, other, strict=True))
