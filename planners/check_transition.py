"""CheckTransition: whether a planner may use a transition (Algorithm 1)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit
from sklearn.utils.validation import check_is_fitted

from reliability.labels import RELIABLE, UNRELIABLE
from systems.system import Array, System
from systems.validation import check_number

_NAMES = {"reliable": True, "unreliable": False}


class CheckTransition:
    """Accepts Reliable transitions, and Unreliable ones with a small probability.

    Parameters
    ----------
    system : System
        Describes transitions to the estimator.
    estimator : estimator or None
        Anything fitted with ``predict`` and ``classes_``; None accepts every transition. Classes
        are 1 and 0, or "reliable" and "unreliable" in any case. An estimator that offers
        ``fast_decision_function`` is asked through that.
    k : float
        An Unreliable transition is accepted with the probability exp(-k * p_acc).
    accuracy : float or None
        p_acc; None takes the estimator's ``validation_accuracy_``.
    rng : Generator
        Source of the draws, one for each Unreliable transition each time that it is checked.

    Attributes
    ----------
    n_checked, n_rejected, n_accepted_unreliable : int
        Counts of transitions so far.

    Raises
    ------
    ValueError
        If k or p_acc is out of range, p_acc is unknown, or the estimator doesn't fit the system.
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
    ) -> None:
        self.n_checked = self.n_rejected = self.n_accepted_unreliable = 0
        self._system = system
        self._estimator = estimator
        self._rng = rng
        check_number(k, "k", 0, np.inf)
        if estimator is None:
            return
        self._reliable_column = _reliable_column(_checked_classes(estimator))
        _check_n_features(system, estimator)
        p_acc = _resolve_accuracy(estimator, accuracy)
        self._acceptance = 0.0 if k == np.inf else float(np.exp(-k * p_acc))
        self._fast = getattr(estimator, "fast_decision_function", None)

    @property
    def answers_fast(self) -> bool:
        """Whether single transitions cost about as little as those of a large batch."""
        if self._estimator is None:
            return True
        return self._fast is not None and not getattr(self._estimator, "prefers_batches", False)

    def __call__(self, reduced: Array, next_reduced: Array) -> NDArray[np.bool_]:
        """Accept or reject transitions that g found valid, drawing anew at each call.

        Parameters
        ----------
        reduced, next_reduced : ndarray of shape (n, reduced_dim)

        Returns
        -------
        accepted : ndarray of bool of shape (n,)
        """
        accepted = self.classify(reduced, next_reduced)
        n_reliable = int(np.count_nonzero(accepted))
        n_unreliable = len(accepted) - n_reliable
        if n_unreliable:
            accepted[~accepted] = self._rng.random(n_unreliable) < self._acceptance
            n_lucky = int(np.count_nonzero(accepted)) - n_reliable
            self.n_accepted_unreliable += n_lucky
            self.n_rejected += n_unreliable - n_lucky
        return accepted

    def classify(self, reduced: Array, next_reduced: Array) -> NDArray[np.bool_]:
        """Say which transitions are classified as Reliable: the paper's Classify."""
        if self._estimator is None or len(reduced) == 0:
            return np.ones(len(reduced), dtype=np.bool_)
        self.n_checked += len(reduced)
        return self._predict(self._system.features(reduced, next_reduced))

    def probability(self, reduced: Array, next_reduced: Array) -> Array:
        """Return the probability that each transition is Reliable; not counted, and no draws."""
        if self._estimator is None:
            return np.ones(len(reduced))
        return self._probability(self._system.features(reduced, next_reduced))

    def evaluate(self, reduced: Array, next_reduced: Array) -> tuple[NDArray[np.bool_], Array]:
        """Return :meth:`classify` and :meth:`probability` in one."""
        if self._estimator is None or len(reduced) == 0:
            return np.ones(len(reduced), dtype=np.bool_), np.ones(len(reduced))
        self.n_checked += len(reduced)
        rows = self._system.features(reduced, next_reduced)
        if self._fast is not None:
            probability = self._probability(rows)
            return probability > 0.5, probability
        reliable = self._predict(rows)
        if not hasattr(self._estimator, "predict_proba"):
            return reliable, reliable.astype(np.float64)
        return reliable, self._probability(rows)

    def _probability(self, rows: NDArray[Any]) -> Array:
        if self._reliable_column is None or len(rows) == 0:
            return np.zeros(len(rows))
        if self._fast is not None:
            logits = self._fast(rows).astype(np.float64)
            return expit(logits if self._reliable_column == 1 else -logits)
        if not hasattr(self._estimator, "predict_proba"):
            return self._predict(rows).astype(np.float64)
        columns = np.asarray(self._estimator.predict_proba(rows), dtype=np.float64)
        return columns[:, self._reliable_column]

    def _predict(self, rows: NDArray[Any]) -> NDArray[np.bool_]:
        if self._reliable_column is None or len(rows) == 0:
            return np.zeros(len(rows), dtype=np.bool_)
        if self._fast is not None:
            return (self._fast(rows) > 0) == self._reliable_column
        predicted = np.asarray(self._estimator.predict(rows))
        return predicted == self._estimator.classes_[self._reliable_column]


def negative_log_likelihood(probability: Array) -> Array:
    """Return -log of the probability that a transition is Reliable; a plan's add up."""
    return -np.log(np.maximum(probability, 1e-12))


def _checked_classes(estimator: Any) -> list[Any]:
    if not hasattr(estimator, "predict"):
        raise ValueError(f"estimator must have the method predict, got {estimator!r}.")
    if hasattr(estimator, "fit"):
        check_is_fitted(estimator)
    if not hasattr(estimator, "classes_"):
        raise ValueError(f"estimator must be a fitted classifier with classes_, got {estimator!r}.")
    return list(estimator.classes_)


def _reliable_column(classes: list[Any]) -> int | None:
    meanings = [_means_reliable(label) for label in classes]
    if None in meanings or len(set(meanings)) != len(classes):
        raise ValueError(
            f"estimator must have the classes {RELIABLE} (Reliable) and {UNRELIABLE} (Unreliable), "
            f'or "reliable" and "unreliable", got {classes}.'
        )
    return meanings.index(True) if True in meanings else None


def _means_reliable(label: Any) -> bool | None:
    if isinstance(label, str):
        return _NAMES.get(label.lower())
    return {RELIABLE: True, UNRELIABLE: False}.get(label)


def _check_n_features(system: System, estimator: Any) -> None:
    expected = getattr(estimator, "n_features_in_", None)
    state = np.zeros((1, system.reduced_dim))
    given = system.features(state, state).shape[1]
    if expected is not None and expected != given:
        raise ValueError(
            f"estimator was fitted on {expected} features, and {type(system).__name__} gives "
            f"{given}; fit it on transitions of this system."
        )


def _resolve_accuracy(estimator: Any, accuracy: float | None) -> float:
    if accuracy is None:
        accuracy = getattr(estimator, "validation_accuracy_", None)
    if accuracy is None or (isinstance(accuracy, float) and np.isnan(accuracy)):
        raise ValueError(
            f"accuracy (p_acc) is not known: {type(estimator).__name__} has no "
            "validation_accuracy_ of held-out data. Pass accuracy, measured on plans that the "
            "estimator was not fitted on."
        )
    check_number(accuracy, "accuracy", 0, 1)
    return float(accuracy)
