"""Probabilities of a network that is too sure, made right on rows that it has not seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

_SMALLEST = 0.05


def temperature_factor(
    logits: NDArray[np.float64], positive: NDArray[np.bool_], weight: NDArray[np.float64]
) -> float:
    """Return what to multiply logits by so that their probabilities fit labels best.

    The inverse of Guo's temperature, which has no influence on labels. At most 1: few rows that are
    all predicted right tell little about how sure to be.

    Parameters
    ----------
    logits : ndarray of shape (n,)
    positive : ndarray of bool of shape (n,)
        The labels.
    weight : ndarray of shape (n,)

    Returns
    -------
    factor : float
        From 0.05 to 1; 1 without rows of any weight.

    References
    ----------
    Guo et al. 2017, "On calibration of modern neural networks".
    """
    return _fit(logits, positive, weight)[0]


def calibrated_loss(
    logits: NDArray[np.float64], positive: NDArray[np.bool_], weight: NDArray[np.float64]
) -> float:
    """Return the mean cross-entropy of logits that are multiplied by that factor."""
    return _fit(logits, positive, weight)[1]


def _fit(
    logits: NDArray[np.float64], positive: NDArray[np.bool_], weight: NDArray[np.float64]
) -> tuple[float, float]:
    if not weight.any():
        return 1.0, float("nan")
    # Large where a label is predicted with confidence, negative where another is.
    margin = np.where(positive, logits, -logits)

    def loss(factor: float) -> float:
        return float(np.average(np.logaddexp(0, -factor * margin), weights=weight))

    best = float(minimize_scalar(loss, bounds=(_SMALLEST, 1), method="bounded").x)
    factor = best if loss(best) < loss(1) else 1.0
    return factor, loss(factor)
