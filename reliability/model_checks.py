"""Whether a model that was read from a file can be asked without harm."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator
from sklearn.ensemble import BaseEnsemble, HistGradientBoostingClassifier
from sklearn.tree import BaseDecisionTree
from sklearn.utils.validation import check_is_fitted

from reliability.classifier import TransitionReliabilityClassifier
from reliability.fast_inference.trees import check_boosting_nodes, check_tree_nodes
from systems.validation import is_integer

_MOST_FEATURES = 10**7


def check_model(model: Any) -> None:
    """Raise unless a model's trees and weights fit together and it answers for a row.

    scikit-learn and compiled code follow the indices in trees without looking: a wrong one would
    end the process, or never come to a leaf.

    Parameters
    ----------
    model : estimator

    Raises
    ------
    ValueError
        If a part is damaged.
    """
    if not isinstance(model, BaseEstimator):
        raise ValueError(f"estimator must be one of scikit-learn's kind, got {model!r}.")
    for part, n_features in _parts(model, None, set()):
        if isinstance(part, BaseDecisionTree):
            check_tree_nodes(part.tree_, n_features, type(part).__name__)
        elif isinstance(part, HistGradientBoostingClassifier):
            _check_boosting(part, n_features)
        elif isinstance(part, TransitionReliabilityClassifier):
            part.check_weights()
    _check_answer(model)


def _parts(thing: Any, limit: int | None, seen: set[int]) -> Iterator[tuple[BaseEstimator, int]]:
    """Yield the estimators within a model, each with the number of features it may look at.

    A part of an ensemble is asked about the ensemble's rows and not about rows of its own.
    """
    if id(thing) in seen:
        return
    seen.add(id(thing))
    inner: Any = ()
    if isinstance(thing, BaseEstimator):
        n_features = vars(thing).get("n_features_in_")
        if n_features is not None:
            n_features = _checked_count(n_features, limit, type(thing).__name__)
            yield thing, n_features
        limit = n_features if isinstance(thing, BaseEnsemble) else None
        inner = vars(thing).values()
    elif isinstance(thing, dict):
        inner = thing.values()
    elif isinstance(thing, list | tuple):
        inner = thing
    elif isinstance(thing, np.ndarray) and thing.dtype.hasobject:
        inner = thing.ravel().tolist()
    elif hasattr(thing, "__dict__") and not isinstance(thing, type):
        limit, inner = None, vars(thing).values()
    for part in inner:
        yield from _parts(part, limit, seen)


def _checked_count(n_features: Any, limit: int | None, name: str) -> int:
    if not is_integer(n_features) or not 0 < n_features <= _MOST_FEATURES:
        raise ValueError(f"{name}.n_features_in_ is {n_features!r}")
    return int(n_features) if limit is None else min(int(n_features), limit)


def _check_boosting(model: Any, n_features: int) -> None:
    name = type(model).__name__
    if not isinstance(model._predictors, list):
        raise ValueError(f"{name} has no trees")
    trees = [tree.nodes for of_iteration in model._predictors for tree in of_iteration]
    check_boosting_nodes(trees, n_features, name)


def _check_answer(model: Any) -> None:
    check_is_fitted(model)
    n_features = _checked_count(model.n_features_in_, None, type(model).__name__)
    dtype = np.uint8 if getattr(model, "_packed", False) else np.float64
    row: NDArray[Any] = np.zeros((1, n_features), dtype)
    answer = np.asarray(model.predict(row))
    if answer.shape != (1,) or answer[0] not in model.classes_:
        raise ValueError(f"predict gives {answer!r} for one row")
    if hasattr(model, "predict_proba") and not np.isfinite(model.predict_proba(row)).all():
        raise ValueError("predict_proba gives NaN")
