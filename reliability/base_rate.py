"""Whether predictions are better than one and the same answer for all rows."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.metrics import balanced_accuracy_score

from reliability.plan_gains import SIGNIFICANCE, gains_of_plans, p_value

# Below, a classifier is weak: 0.5 is chance, and 0.7 that of one that recognizes, for example, half
# of the rarer label at a false alarm in ten.
WEAK_BALANCED_ACCURACY = 0.7
# With fewer, a validation accuracy says too little to warn of it.
_FEWEST_GROUPS = 50
_FEWEST_OF_RARER_LABEL = 20


class BaseRateWarning(UserWarning):
    """A classifier predicts held-out rows no better than one label for all of them would."""


def weighted_share(mask: NDArray[np.bool_], weight: NDArray[np.float64]) -> float:
    """Return the share of True by weight; NaN without any weight."""
    total = weight.sum()
    return float(weight[mask].sum() / total) if total else float("nan")


def beats_base_rate(
    label: NDArray[Any],
    right: NDArray[np.bool_],
    groups: ArrayLike,
    weight: NDArray[np.float64] | None = None,
) -> bool:
    """Say whether predictions are right more often than the more frequent label, beyond chance.

    Rows of one group, a plan's, go well or wrong together, so that the gain over the more frequent
    label is added up in each group, and a t-test asks whether groups gain at all.

    Parameters
    ----------
    label : ndarray of 0 and 1 of shape (n,), n >= 1
    right : ndarray of bool of shape (n,)
        Whether each row's label is predicted.
    groups : array-like of shape (n,)
    weight : ndarray of shape (n,), default=None
        None weighs all rows alike.

    Returns
    -------
    beats : bool
    """
    weight = np.ones(len(label)) if weight is None else weight
    more_frequent = weighted_share(label == 1, weight) >= 0.5
    gain = right.astype(float) - (label == more_frequent)
    return p_value(gains_of_plans(weight * gain, groups), "greater") < SIGNIFICANCE


def warn_if_no_better_than_base_rate(
    label: NDArray[Any],
    right: NDArray[np.bool_],
    groups: ArrayLike,
    weight: NDArray[np.float64],
) -> None:
    """Warn of an accuracy that says nothing, where enough plans were held out to tell.

    A classifier that was trained to see both labels alike often has an accuracy below the base
    rate, and is useful nevertheless: it is told by its balanced accuracy.
    """
    of_rarer = np.bincount(label, minlength=2).min()
    if of_rarer < _FEWEST_OF_RARER_LABEL or len(np.unique(np.asarray(groups))) < _FEWEST_GROUPS:
        return
    predicted = np.where(right, label, 1 - label)
    balanced = balanced_accuracy_score(label, predicted, sample_weight=weight)
    if balanced >= WEAK_BALANCED_ACCURACY or beats_base_rate(label, right, groups, weight):
        return
    ones = weighted_share(label == 1, weight)
    warnings.warn(
        f"The validation accuracy, {weighted_share(right, weight):.3f}, is no better than that of "
        f"one label for every row, {max(ones, 1 - ones):.3f}. Ask reliability.diagnose what may be "
        "wrong.",
        BaseRateWarning,
        stacklevel=3,
    )
