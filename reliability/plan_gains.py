"""Whether single plans gain something, beyond chance: a t-test over plans."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import ttest_1samp

# A difference counts as more than chance if chance makes one as large this rarely.
SIGNIFICANCE = 0.05


def gains_of_plans(gain: NDArray[np.float64], plan: ArrayLike) -> NDArray[np.float64]:
    """Add up what the transitions of each plan gain.

    Transitions of one plan go well or wrong together, so that plans, not transitions, are the
    independent observations.

    Parameters
    ----------
    gain : ndarray of shape (n,)
        Of each transition.
    plan : array-like of shape (n,)
        Which plan each belongs to.

    Returns
    -------
    gains : ndarray of shape (n_plans,)
    """
    _, number = np.unique(np.asarray(plan), return_inverse=True)
    return np.bincount(number, gain).astype(float)


def p_value(
    gains: NDArray[np.float64], alternative: Literal["two-sided", "greater"] = "two-sided"
) -> float:
    """Return how probable such gains of plans are if there is none in truth.

    Parameters
    ----------
    gains : ndarray of shape (n_plans,), n_plans >= 1
    alternative : {"two-sided", "greater"}, default="two-sided"
        What else there may be in truth: any difference, or a gain only.

    Returns
    -------
    p : float
        Where all gains are equal, so that there is no spread to compare them with, 0 if they are
        as the alternative says and 1 if not.
    """
    if np.ptp(gains) == 0:
        is_alternative = gains[0] > 0 if alternative == "greater" else gains[0] != 0
        return 0.0 if is_alternative else 1.0
    return float(ttest_1samp(gains, 0, alternative=alternative).pvalue)
