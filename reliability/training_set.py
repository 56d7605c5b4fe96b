"""Labels, weights and the held-out part of a training set."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.model_selection import GroupShuffleSplit, ShuffleSplit
from sklearn.utils import compute_class_weight
from sklearn.utils.multiclass import type_of_target
from sklearn.utils.validation import check_consistent_length


def encode_labels(y: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.intp]]:
    """Return the sorted classes, one or two, and each row's index among them.

    Raises
    ------
    ValueError
        If there are more than two classes, or y is no target of a classifier.
    """
    kind = type_of_target(y, input_name="y", raise_unknown=True)
    if kind != "binary":
        raise ValueError(
            f"Only binary classification is supported. The type of the target is {kind}."
        )
    return np.unique(y, return_inverse=True)


def weigh_rows(
    y: NDArray[Any],
    classes: NDArray[Any],
    class_weight: dict[Any, float] | str | None,
    sample_weight: ArrayLike | None,
) -> NDArray[np.float64]:
    """Return the product of each row's weight and that of its class, shape (n,).

    Raises
    ------
    ValueError
        If ``sample_weight`` is not one finite weight per row, none of them negative.
    """
    weight = np.ones(len(y))
    if sample_weight is not None:
        weight = np.array(sample_weight, dtype=np.float64)
        if weight.shape != (len(y),) or not (np.isfinite(weight) & (weight >= 0)).all():
            raise ValueError(
                f"sample_weight must hold {len(y)} finite weights that are not negative, "
                f"got the shape {weight.shape}."
            )
    if class_weight is not None:
        per_class = compute_class_weight(class_weight, classes=classes, y=y)
        weight *= per_class[np.searchsorted(classes, y)]
    return weight


def hold_out(
    n_rows: int, groups: ArrayLike | None, fraction: float, rng: np.random.Generator
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Split rows at random into those to train on and those to validate on.

    Parameters
    ----------
    n_rows : int
    groups : array-like of shape (n_rows,) or None
        Rows of one group stay together.
    fraction : float
        Share of the groups, or of the rows, to hold out; at least one is left to train on.
    rng : Generator

    Returns
    -------
    training, held_out : ndarray of int
    """
    seed = int(rng.integers(2**31))
    n_units = n_rows
    if groups is not None:
        check_consistent_length(np.zeros(n_rows), groups)
        n_units = len(np.unique(np.asarray(groups)))
    n_held_out = min(round(fraction * n_units), n_units - 1)
    if n_held_out < 1:
        return np.arange(n_rows), np.arange(0)
    splitter = ShuffleSplit if groups is None else GroupShuffleSplit
    split = splitter(1, test_size=n_held_out, random_state=seed)
    return next(split.split(np.zeros(n_rows), groups=groups))
