"""CheckTransition: whether a planner may use a transition (Algorithm 1)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from planners.acceptance import make_acceptance
from planners.estimator_adapter import adapt_estimator
from systems.system import Array, System


class CheckTransition:
    """Accepts Reliable transitions, and of Unreliable ones those that a rule lets through.

    Parameters
    ----------
    system : System
        Describes transitions to the estimator.
    estimator : estimator or None
        Anything fitted with ``predict`` and ``classes_``; None accepts every transition. Classes
        are 1 and 0, or "reliable" and "unreliable" in any case. Where
        :func:`reliability.compile_inference` knows the estimator, it is asked through that.
    k : float
        How strict the rule is; infinite rejects every Unreliable transition.
    accuracy : float or None
        p_acc, of which the rule "fixed" makes use; None takes the estimator's
        ``validation_accuracy_``.
    rng : Generator
        Source of the draws, one for each Unreliable transition each time that it is checked.
    acceptance : {"fixed", "probability", "temperature"}, default="fixed"
        The rule, as :class:`BiasedRRT` describes it.

    Attributes
    ----------
    n_checked, n_rejected, n_accepted_unreliable : int
        Counts of transitions so far.

    Raises
    ------
    ValueError
        If a parameter is out of range, p_acc is unknown where it is needed, the estimator doesn't
        fit the system, or the rule needs probabilities and the estimator has none.
    sklearn.exceptions.NotFittedError
        If the estimator is not fitted.

    References
    ----------
    McConachie et al. 2020, Algorithm 1.
    """

    def __init__(
        self,
        system: System,
        estimator: Any,
        *,
        k: float,
        accuracy: float | None,
        rng: np.random.Generator,
        acceptance: str = "fixed",
    ) -> None:
        self.n_checked = self.n_rejected = self.n_accepted_unreliable = 0
        self._adapter = adapt_estimator(system, estimator)
        self._counts = estimator is not None
        self._acceptance = make_acceptance(acceptance, estimator, k, accuracy, rng)

    def __repr__(self) -> str:
        return f"<CheckTransition: {self.n_checked} checked, {self.n_rejected} rejected>"

    @property
    def answers_fast(self) -> bool:
        """Whether a search may ask about single transitions, rather than about many at a time."""
        return self._adapter.answers_fast

    def __call__(self, reduced: Array, next_reduced: Array) -> NDArray[np.bool_]:
        """Accept or reject transitions that g found valid, drawing anew at each call.

        Parameters
        ----------
        reduced, next_reduced : ndarray of shape (n, reduced_dim)

        Returns
        -------
        accepted : ndarray of bool of shape (n,)
        """
        probability = None
        if self._acceptance.needs_cost:
            accepted, probability = self.evaluate(reduced, next_reduced)
        else:
            accepted = self.classify(reduced, next_reduced)
        n_reliable = int(np.count_nonzero(accepted))
        n_unreliable = len(accepted) - n_reliable
        if n_unreliable:
            unreliable = ~accepted
            cost = np.zeros(n_unreliable)
            if probability is not None:
                cost = negative_log_likelihood(probability[unreliable])
            accepted[unreliable] = self._acceptance.draw(cost)
            n_lucky = int(np.count_nonzero(accepted)) - n_reliable
            self.n_accepted_unreliable += n_lucky
            self.n_rejected += n_unreliable - n_lucky
        return accepted

    def classify(self, reduced: Array, next_reduced: Array) -> NDArray[np.bool_]:
        """Say which transitions are classified as Reliable: the paper's Classify."""
        self.n_checked += self._counts * len(reduced)
        return self._adapter.classify(reduced, next_reduced)

    def probability(self, reduced: Array, next_reduced: Array) -> Array:
        """Return the probability that each transition is Reliable; not counted, and no draws."""
        return self._adapter.probability(reduced, next_reduced)

    def evaluate(self, reduced: Array, next_reduced: Array) -> tuple[NDArray[np.bool_], Array]:
        """Return :meth:`classify` and :meth:`probability` in one."""
        self.n_checked += self._counts * len(reduced)
        return self._adapter.evaluate(reduced, next_reduced)


def negative_log_likelihood(probability: Array) -> Array:
    """Return -log of the probability that a transition is Reliable; a plan's add up."""
    return -np.log(np.maximum(probability, 1e-12))
