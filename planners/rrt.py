"""Biased RRT."""

from __future__ import annotations

from planners.batch_rrt import BatchRRT
from planners.biased_planner import BiasedPlanner
from planners.search import Found, Search


class BiasedRRT(BiasedPlanner):
    """RRT that is biased away from transitions that an estimator calls Unreliable.

    For every system: whatever a reduced state holds besides its configuration is propagated along
    the tree. The tree grows towards several samples at a time, by one transition each per question
    to the estimator, until a sample is reached or a transition is rejected.

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
    simplify : bool, default=True
        Take shortcuts of which every transition is classified Reliable.
    max_iterations : int, default=20000
        Samples to grow towards before giving up; each restart begins anew.
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
    LaValle 1998; McConachie et al. 2020, Algorithm 1; for the temperature Jaillet, Cortés and
    Siméon 2010 (T-RRT).

    Examples
    --------
    >>> from planners import BiasedRRT
    >>> from systems import PlanarArm
    >>> BiasedRRT(PlanarArm(), random_state=0).plan([-1.5, 0.0, 0.0], [1.5, 0.0, 0.0]).success
    True
    """

    def _search(self, search: Search) -> Found:
        rrt = BatchRRT(search.problem, search.check, search.rng)
        path = rrt.grow(search.budget)
        return Found(path, rrt.tree.edges())
