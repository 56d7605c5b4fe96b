"""Which of the transitions that an estimator calls Unreliable a search accepts all the same."""

from __future__ import annotations

import math
import warnings
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from reliability.exploration import is_exploring
from systems.system import Array
from systems.validation import check_choice, check_number

ACCEPTANCES = ("fixed", "probability", "temperature")
# T-RRT's nFailMax and α.
REJECTIONS_TO_RISE = 100
TEMPERATURE_FACTOR = 2.0
# Halving for ever would end in a division by zero.
_LOWEST_TEMPERATURE = 1e-9
# Above this share of accepted Unreliable transitions, planners warn.
_PERMISSIVE = 0.1
_WARNED: set[str] = set()


class PermissiveAcceptanceWarning(UserWarning):
    """k lets a search accept more than a tenth of the transitions that are called Unreliable."""


class Acceptance(Protocol):
    """A rule that says which Unreliable transitions to accept.

    Attributes
    ----------
    needs_cost : bool
        Whether the rule looks at what transitions cost.
    """

    needs_cost: bool

    def draw(self, cost: Array) -> NDArray[np.bool_]:
        """Accept or reject Unreliable transitions, with one random number for each.

        Parameters
        ----------
        cost : ndarray of shape (n,)
            -log of the probability that each transition is Reliable; anything if not needed.

        Returns
        -------
        accepted : ndarray of bool of shape (n,)
        """


class FixedAcceptance:
    """Accepts each with the same probability: the paper's Algorithm 1.

    Parameters
    ----------
    share : float
        That probability, exp(-k * p_acc).
    rng : Generator
    """

    needs_cost = False

    def __init__(self, share: float, rng: np.random.Generator) -> None:
        self._share = share
        self._rng = rng

    def draw(self, cost: Array) -> NDArray[np.bool_]:
        """Accept the same share, whatever transitions cost."""
        return self._rng.random(len(cost)) < self._share


class ProbabilityAcceptance:
    """Accepts each with the probability p ** k, where p is that of being Reliable.

    With k = 1 a transition's label is drawn from what the estimator believes of it. With a larger
    whole number, k such draws have to be Reliable.

    Parameters
    ----------
    k : float
        Finite.
    rng : Generator
    """

    needs_cost = True

    def __init__(self, k: float, rng: np.random.Generator) -> None:
        self._k = k
        self._rng = rng

    def draw(self, cost: Array) -> NDArray[np.bool_]:
        """Accept each with a probability of its own."""
        return self._rng.random(len(cost)) < np.exp(-self._k * cost)


class TemperatureAcceptance:
    """Accepts each with the probability exp(-cost / temperature), which adapts to the search.

    The temperature starts at 1 / k. It doubles each time that 100 Unreliable transitions have
    been rejected in a row, and halves when one is accepted. So a search that is stuck takes more
    and more risk, beginning with the transitions that are most probably Reliable, and a search
    that has got through becomes strict again. In the long run about one of 100 is accepted.

    Parameters
    ----------
    k : float
        Finite.
    rng : Generator

    References
    ----------
    Jaillet, Cortés and Siméon 2010, "Sampling-based path planning on configuration-space costmaps"
    (T-RRT), whose cost of a move is here that of being wrong about it.
    """

    needs_cost = True

    def __init__(self, k: float, rng: np.random.Generator) -> None:
        self.temperature = 1 / k if k > 0 else math.inf
        self._rng = rng
        self._n_rejected = 0

    def draw(self, cost: Array) -> NDArray[np.bool_]:
        """Accept or reject one after another: each answer may change the temperature."""
        drawn = zip(self._rng.random(len(cost)).tolist(), cost.tolist(), strict=True)
        return np.array([self._accepts(number, one) for number, one in drawn], dtype=np.bool_)

    def _accepts(self, number: float, cost: float) -> bool:
        if number < math.exp(-cost / self.temperature):
            self.temperature = max(self.temperature / TEMPERATURE_FACTOR, _LOWEST_TEMPERATURE)
            self._n_rejected = 0
            return True
        self._n_rejected += 1
        if self._n_rejected == REJECTIONS_TO_RISE:
            self.temperature *= TEMPERATURE_FACTOR
            self._n_rejected = 0
        return False


def make_acceptance(
    acceptance: str, estimator: Any, k: float, accuracy: float | None, rng: np.random.Generator
) -> Acceptance:
    """Return the rule of a planner with these parameters.

    Raises
    ------
    ValueError
        If a parameter is out of range, or the rule needs what is not known of the estimator.
    """
    check_choice(acceptance, "acceptance", ACCEPTANCES)
    check_number(k, "k", 0, np.inf)
    if accuracy is not None:
        check_number(accuracy, "accuracy", 0, 1)
    if estimator is None:  # which calls nothing Unreliable
        return FixedAcceptance(0.0, rng)
    if acceptance == "fixed":
        return FixedAcceptance(fixed_share(k, resolve_accuracy(estimator, accuracy)), rng)
    _check_has_probabilities(estimator, acceptance)
    if k == np.inf:
        return FixedAcceptance(0.0, rng)
    rule = ProbabilityAcceptance if acceptance == "probability" else TemperatureAcceptance
    return rule(float(k), rng)


def resolve_accuracy(estimator: Any, accuracy: float | None) -> float:
    """Return p_acc: what is given, else what the estimator knows of itself."""
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


def fixed_share(k: float, p_acc: float) -> float:
    """Return exp(-k * p_acc), also where k is infinite and p_acc zero."""
    return 0.0 if k == np.inf else float(np.exp(-k * p_acc))


def warn_if_permissive(k: float, p_acc: float, stacklevel: int) -> None:
    """Warn, once for each k and p_acc, where Algorithm 1 accepts many Unreliable transitions.

    Nothing is said while data are collected: what an estimator is wrong about comes to light only
    where plans hold what it calls Unreliable.
    """
    share = fixed_share(k, p_acc)
    if share <= _PERMISSIVE or is_exploring():
        return
    stricter = 10 if fixed_share(10, p_acc) < _PERMISSIVE / 10 else np.inf
    message = (
        f"k={float(k):g} with p_acc {p_acc:.2f} accepts {100 * share:.2g} % of the transitions "
        "that the estimator calls Unreliable, so that plans may hold some; "
        f"k={stricter:g} accepts {100 * fixed_share(stricter, p_acc):.2g} %."
    )
    # Python itself forgets what it has shown whenever a warning filter changes, which some
    # estimators do each time that they are asked.
    if message not in _WARNED:
        warnings.warn(message, PermissiveAcceptanceWarning, stacklevel=stacklevel + 1)
        _WARNED.add(message)


def _check_has_probabilities(estimator: Any, acceptance: str) -> None:
    if not hasattr(estimator, "predict_proba"):
        raise ValueError(
            f"acceptance={acceptance!r} needs an estimator with predict_proba, and "
            f"{type(estimator).__name__} has none. Wrap it in "
            "sklearn.calibration.CalibratedClassifierCV, or use acceptance='fixed'."
        )
