"""Biased RRT-Connect."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass

import numpy as np

from planners.batch_rrt_connect import BatchRRTConnect
from planners.biased_planner import BiasedPlanner
from planners.edge_checker import EdgeChecker
from planners.edge_discretization import split_edges
from planners.ompl_backend import ompl_can_search, ompl_rrt_connect
from planners.path import Path
from planners.search import Found, Search
from systems.system import Array
from systems.validation import check_count


@dataclass(eq=False, repr=False)
class BiasedRRTConnect(BiasedPlanner):
    """RRT-Connect that is biased away from transitions that an estimator calls Unreliable.

    For systems whose reduced state is only a configuration, and which can be steered exactly from
    one configuration to another. OMPL's own RRT-Connect searches when the estimator answers
    quickly for single transitions; for all other estimators, for configurations with angles that
    wrap, for goal regions and for starts out of bounds, one that asks about the edges of several
    extensions at a time.

    Parameters
    ----------
    system : System
    estimator : estimator, default=None
        Any fitted classifier of ``system.features``; None plans without bias.
    k : float, default=1.0
        How strict the search is, see ``acceptance``; np.inf rejects every Unreliable transition.
        With "fixed" and p_acc 0.9, the default accepts 41 % of them and k=10 0.01 %; planners warn
        of more than a tenth (:class:`PermissiveAcceptanceWarning`).
    accuracy : float, default=None
        p_acc, the estimator's accuracy on held-out data, which only "fixed" needs. None takes
        ``validation_accuracy_``.
    acceptance : {"fixed", "probability", "temperature"}, default="fixed"
        How the search accepts transitions that the estimator calls Unreliable; Reliable ones are
        always accepted.

        - "fixed": each with the probability exp(-k * p_acc), the paper's Algorithm 1.
        - "probability": each with p ** k, where p is the estimator's own probability that this
          transition is Reliable. With k=1 its label is drawn from what the estimator believes; with
          k=3, three such draws have to be Reliable: 0.06 for p = 0.4, and 0.001 for p = 0.1.
        - "temperature": each with p ** (1 / T), with a temperature T that begins at 1 / k, doubles
          each time that 100 Unreliable transitions have been rejected in a row, and halves when one
          is accepted. A search that is stuck takes ever greater risks, the smallest first.

        The last two need ``predict_proba``, and are as good as its probabilities are calibrated.
        Recommended are "fixed" with k=10, and "probability" with k=3 where that finds no plan: see
        ``docs/acceptance.md``, which compares the three.
    transitions_per_edge : int, default=5
        Longest edge of the trees, in transitions. An edge is added only if every one of its
        transitions is accepted, so the longer the edges, the stronger the bias at the same k.
    simplify : bool, default=True
        Take shortcuts of which every transition is classified Reliable.
    max_iterations : int, default=20000
        Samples to draw before giving up; each restart begins anew.
    time_limit : float, default=None
        Seconds to search before giving up, all restarts together. Only without it are results the
        same on every machine.
    calibration : SuccessCalibration, default=None
        Fitted on executed plans; gives each plan its ``success_probability``. None takes the
        product of the transitions' reliabilities, which is seldom a frequency of success.
    min_success : float, default=0.0
        A plan whose ``success_probability`` is less gets the status ``DISTRUSTED``.
    restarts : int, default=0
        How often to plan again, with seeds that follow from ``random_state``. The plan with the
        highest ``success_probability`` is returned; times and counts add up. Planning ends early
        with a plan of at least ``min_success``, or of 1 where ``min_success`` is 0: then all
        restarts are made, and the likeliest plan is carried out, however unlikely it is.
    random_state : int, Generator, RandomState, SeedSequence or None, default=None
    verbose : int, default=0
        1 shows a progress bar during the search, and tells what it found and what became of it.

    References
    ----------
    Kuffner and LaValle 2000; McConachie et al. 2020, Algorithm 1; for the temperature Jaillet,
    Cortés and Siméon 2010 (T-RRT).

    Examples
    --------
    >>> from planners import BiasedRRTConnect
    >>> from systems import PlanarArm
    >>> planner = BiasedRRTConnect(PlanarArm(), random_state=0)
    >>> planner.plan([-1.5, 0.0, 0.0], [1.5, 0.0, 0.0]).success
    True
    """

    _: KW_ONLY
    transitions_per_edge: int = 5

    def _check_parameters(self) -> None:
        super()._check_parameters()
        check_count(self.transitions_per_edge, "transitions_per_edge")
        extra = self.system.reduced_dim - self.system.configuration_dim
        if extra:
            raise ValueError(
                "BiasedRRTConnect needs a system whose reduced state is only a configuration, and "
                f"that of {type(self.system).__name__} holds {extra} more numbers; use BiasedRRT."
            )

    def _search(self, search: Search) -> Found:
        checker = EdgeChecker(self.system, search.check)
        vertices = self._vertices(search, checker)
        path = None if vertices is None else self._path_along(vertices)
        return Found(path, checker.accepted_edges())

    def _vertices(self, search: Search, checker: EdgeChecker) -> Array | None:
        problem, budget = search.problem, search.budget
        longest_edge = self.transitions_per_edge * self.system.step_size
        if search.check.answers_fast and ompl_can_search(problem):
            return ompl_rrt_connect(problem, checker, longest_edge, budget, search.ompl_seed)
        return BatchRRTConnect(problem, checker, longest_edge, search.rng).grow(budget)

    def _path_along(self, vertices: Array) -> Path:
        """Return the path along edges, cut into transitions as when the edges were checked."""
        origins, targets, _ = split_edges(
            vertices[:-1], vertices[1:], self.system.step_size, self.system.angular
        )
        reduced = np.concatenate([origins[:1], targets])
        return Path(reduced, self.system.steer(reduced[:-1], reduced[1:]))
