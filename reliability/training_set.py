"""Labels, weights and the held-out part of a training set."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.model_selection import GroupShuffleSplit, ShuffleSplit
from sklearn.utils import compute_class_weight
from sklearn.utils.multiclass import type_of_target

from systems.validation import as_any_array, as_numbers


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


def check_sample_weight(sample_weight: ArrayLike | None, n_rows: int) -> NDArray[np.float64]:
    """Return one weight per row, 1 if none are given, shape (n_rows,).

    Raises
    ------
    ValueError
        If ``sample_weight`` is not one finite weight per row, none of them negative.
    """
    if sample_weight is None:
        return np.ones(n_rows)
    weight = as_numbers(sample_weight, "sample_weight")
    if weight.shape != (n_rows,) or not (np.isfinite(weight) & (weight >= 0)).all():
        raise ValueError(
            f"sample_weight must hold {n_rows} finite weights that are not negative, "
            f"got the shape {weight.shape}."
        )
    return weight


def weigh_classes(
    y: NDArray[Any], classes: NDArray[Any], class_weight: dict[Any, float] | str | None
) -> NDArray[np.float64]:
    """Return the weight of each row's class, shape (n,)."""
    per_class = compute_class_weight(class_weight, classes=classes, y=y)
    return per_class[np.searchsorted(classes, y)]


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
        n_units = len(np.unique(_checked_groups(groups, n_rows)))
    n_held_out = min(round(fraction * n_units), n_units - 1)
    if n_held_out < 1:
        return np.arange(n_rows), np.arange(0)
    splitter = ShuffleSplit if groups is None else GroupShuffleSplit
    split = splitter(1, test_size=n_held_out, random_state=seed)
    return next(split.split(np.zeros(n_rows), groups=groups))


def _checked_groups(groups: ArrayLike, n_rows: int) -> NDArray[Any]:
    ids = as_any_array(groups, "groups")
    # np.unique tells apart what can be put in order.
    in_order = ids.dtype.kind != "c" and len({type(one) for one in ids.ravel()}) <= 1
    if ids.shape != (n_rows,) or not in_order:
        raise ValueError(
            f"groups must hold {n_rows} plan ids of one type, got {ids.dtype} of the shape "
            f"{ids.shape}."
        )
    return ids


def thin(rows: NDArray[np.intp], n: int | None) -> NDArray[np.intp]:
    """Return at most n of the rows, at equal distances; None takes all."""
    if n is None or len(rows) == 0:
        return rows
    step = -(-len(rows) // n)
    return rows[::step]
