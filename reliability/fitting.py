"""Fitting any classifier on whole plans, and measuring it on plans that it has not seen."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.metrics import balanced_accuracy_score
from sklearn.model_selection import StratifiedGroupKFold, cross_val_predict
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import has_fit_parameter

from reliability.answer_checks import one_per_row
from reliability.item_files import Item
from reliability.named_features import columns_to_ask, columns_to_fit

_N_FOLDS = 5


@dataclass(frozen=True)
class LabelledPlans:
    """Rows to learn from.

    Attributes
    ----------
    X : ndarray of shape (n, n_features)
    y : ndarray of int of shape (n,)
    plan : ndarray of int of shape (n,)
    names : tuple of str or None
        Of the features, None if the system does not say any.
    """

    X: NDArray[Any]
    y: NDArray[np.int64]
    plan: NDArray[np.int64]
    names: tuple[str, ...] | None


@dataclass(frozen=True)
class FitTask:
    """Fits an estimator on all rows, and copies of it on parts of the plans to measure it.

    Attributes
    ----------
    estimator : classifier
        A template, which stays as it is.
    data : LabelledPlans
    seed : int
        For the parts, and for each ``random_state`` of the estimator that is None.
    n_jobs : int or None
        Copies that are fitted at the same time.
    """

    estimator: Any
    data: LabelledPlans
    seed: int
    n_jobs: int | None

    def __call__(self) -> Item:
        """Return the fitted estimator, pickled, and which rows copies of it labelled right.

        Raises
        ------
        ValueError
            If the rows have one label only, or too few plans have both.
        """
        y, plan = self.data.y, self.data.plan
        X = columns_to_fit(self.estimator, self.data.names).of(self.data.X)
        folds = self._folds()
        estimator = with_seeds(clone(self.estimator), self.seed)
        parameters = fit_parameters(estimator, plan)
        predicted = cross_val_predict(
            estimator, X, y, groups=plan, cv=folds, params=parameters, n_jobs=self.n_jobs
        )
        right = one_per_row(predicted, len(y), f"{type(estimator).__name__}.predict") == y
        estimator.fit(X, y, **parameters)
        if np.isnan(getattr(estimator, "validation_accuracy_", np.nan)):
            estimator.validation_accuracy_ = float(right.mean())
        pickled = np.frombuffer(pickle.dumps(estimator, protocol=5), np.uint8)
        return Item({}, {"estimator": pickled, "right": right})

    def _folds(self) -> StratifiedGroupKFold:
        y, plan = self.data.y, self.data.plan
        labels = np.unique(y)
        if len(labels) < 2:
            raise ValueError(
                f"All {len(y):,} transitions have the label {labels[0]}, so that there is nothing "
                "to tell apart: look at the system's close, or raise n_plans."
            )
        n_folds = min(_N_FOLDS, *(len(np.unique(plan[y == label])) for label in labels))
        if n_folds < 2:
            raise ValueError(
                "n_plans is too small: only one plan has transitions of one of the labels, and "
                "none could be held out to measure the estimator."
            )
        return StratifiedGroupKFold(n_folds, shuffle=True, random_state=self.seed % 2**32)


def unpickled(item: Item) -> Any:
    """Return the estimator that a :class:`FitTask` fitted."""
    return pickle.loads(item.arrays["estimator"].tobytes())


def with_seeds(estimator: Any, seed: int) -> Any:
    """Give a seed to each ``random_state`` of an estimator and its parts that is None."""
    for name, value in sorted(estimator.get_params(deep=True).items()):
        if value is None and (name == "random_state" or name.endswith("__random_state")):
            estimator.set_params(**{name: seed % 2**31})
    return estimator


def fit_parameters(estimator: Any, plan: NDArray[np.int64]) -> dict[str, NDArray[np.int64]]:
    """Return the plan ids as ``groups`` for ``fit``, where the estimator takes them."""
    if isinstance(estimator, Pipeline):
        name, last = estimator.steps[-1]
        inner = fit_parameters(last, plan)
        return {f"{name}__{parameter}": value for parameter, value in inner.items()}
    return {"groups": plan} if has_fit_parameter(estimator, "groups") else {}


def correct(estimator: Any, data: LabelledPlans) -> NDArray[np.bool_]:
    """Say which rows an estimator labels right, shape (n,)."""
    if not len(data.y):
        return np.zeros(0, dtype=np.bool_)
    source = f"{type(estimator).__name__}.predict"
    X = columns_to_ask(estimator, data.names, data.X.shape[1]).of(data.X)
    return one_per_row(estimator.predict(X), len(data.y), source) == data.y


def balanced_accuracy(right: NDArray[np.bool_], y: NDArray[np.int64]) -> float:
    """Return the mean of both labels' recalls; NaN if a label is missing."""
    if len(np.unique(y)) < 2:
        return float("nan")
    return float(balanced_accuracy_score(y, np.where(right, y, 1 - y)))
