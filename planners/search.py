"""What a search for a path needs, and what it finds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planners.budget import Budget
from planners.check_transition import CheckTransition
from planners.path import Path
from planners.planning_problem import PlanningProblem
from systems.system import Array


class Search(NamedTuple):
    """Everything that a search needs.

    Attributes
    ----------
    problem : PlanningProblem
    check : CheckTransition
    budget : Budget
    rng : Generator
    ompl_seed : int
        Seed for OMPL's random numbers, positive.
    """

    problem: PlanningProblem
    check: CheckTransition
    budget: Budget
    rng: np.random.Generator
    ompl_seed: int


class Found(NamedTuple):
    """What a search found.

    Attributes
    ----------
    path : Path or None
        From a start to a goal; None if the budget was exhausted first.
    tree : ndarray of shape (n_edges, 2, configuration_dim)
        Configurations at the ends of all accepted edges, in the direction of execution.
    """

    path: Path | None
    tree: Array
