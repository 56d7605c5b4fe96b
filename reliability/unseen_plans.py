"""What an estimator says of plans that it has not been trained on."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator
from sklearn.model_selection import GridSearchCV, GroupKFold, RandomizedSearchCV
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import has_fit_parameter

from reliability.base_rate import BaseRateWarning
from reliability.classifier import TransitionReliabilityClassifier
from reliability.labels import RELIABLE
from reliability.named_features import Columns, columns_to_ask, columns_to_fit


class UnseenPredictions(NamedTuple):
    """Predictions for transitions by an estimator that has not seen their plans.

    Attributes
    ----------
    reliable : ndarray of bool of shape (n,)
        Whether Reliable is predicted.
    probability : ndarray of shape (n,)
        That a transition is Reliable; NaN where the estimator gives no probabilities.
    """

    reliable: NDArray[np.bool_]
    probability: NDArray[np.float64]


def predict_unseen(
    estimator: Any,
    X: NDArray[Any],
    y: NDArray[np.int64],
    plan: NDArray[np.int64],
    n_folds: int,
    n_jobs: int | None = None,
    names: Sequence[str] | None = None,
) -> UnseenPredictions:
    """Train a clone without each fold's plans, and ask it about them.

    A :class:`sklearn.frozen.FrozenEstimator` is asked as it is.

    Parameters
    ----------
    estimator : classifier
        Gets plan ids as ``groups`` if its ``fit`` takes them, or its pipeline's last step's.
    X : ndarray of shape (n, n_features)
    y : ndarray of shape (n,)
    plan : ndarray of int of shape (n,)
        Of at least ``n_folds`` plans.
    n_folds : int
        At least 2.
    n_jobs : int, default=None
        Processes that train.
    names : sequence of str, default=None
        Of the features; estimators that know features by name get tables.

    Returns
    -------
    predictions : UnseenPredictions
    """
    if isinstance(estimator, FrozenEstimator):
        return _answers(estimator, columns_to_ask(estimator, names, X.shape[1]).of(X))
    columns = columns_to_fit(estimator, names)
    folds = list(GroupKFold(n_folds).split(X, y, plan))
    answers = Parallel(n_jobs=n_jobs)(
        delayed(_train_and_ask)(estimator, columns, X, y, plan, *fold) for fold in folds
    )
    joined = UnseenPredictions(np.empty(len(y), np.bool_), np.empty(len(y)))
    for (_, unseen), answer in zip(folds, answers, strict=True):
        joined.reliable[unseen], joined.probability[unseen] = answer
    return joined


def _train_and_ask(
    estimator: Any,
    columns: Columns,
    X: NDArray[Any],
    y: NDArray[np.int64],
    plan: NDArray[np.int64],
    seen: NDArray[np.int64],
    unseen: NDArray[np.int64],
) -> UnseenPredictions:
    if np.ptp(y[seen]) == 0:
        # Many estimators can't be trained on one label.
        known = np.full(len(unseen), y[seen[0]] == RELIABLE)
        return UnseenPredictions(known, known.astype(float))
    trained = _without_checkpoints(clone(estimator))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", BaseRateWarning)
        trained.fit(columns.of(X[seen]), y[seen], **_fit_parameters(trained, plan[seen]))
    return _answers(trained, columns.of(X[unseen]))


def _without_checkpoints(estimator: Any) -> Any:
    """Keep trainings on parts of the data out of the file of the training on all of them."""
    own = {"": estimator, **{f"{name}__": one for name, one in estimator.get_params().items()}}
    networks = [n for n, one in own.items() if isinstance(one, TransitionReliabilityClassifier)]
    return estimator.set_params(**{f"{name}checkpoint": None for name in networks})


def _fit_parameters(estimator: Any, plan: NDArray[np.int64]) -> dict[str, Any]:
    if isinstance(estimator, Pipeline):
        name, last = estimator.steps[-1]
        return {f"{name}__{key}": value for key, value in _fit_parameters(last, plan).items()}
    # Searches give groups to what splits their data.
    takes_groups = isinstance(estimator, GridSearchCV | RandomizedSearchCV)
    return {"groups": plan} if takes_groups or has_fit_parameter(estimator, "groups") else {}


def _answers(trained: Any, X: Any) -> UnseenPredictions:
    reliable = np.asarray(trained.predict(X)) == RELIABLE
    if not hasattr(trained, "predict_proba"):
        return UnseenPredictions(reliable, np.full(len(X), np.nan))
    of_reliable = np.asarray(trained.classes_) == RELIABLE
    return UnseenPredictions(reliable, trained.predict_proba(X)[:, of_reliable].sum(axis=1))
