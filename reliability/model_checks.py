"""Whether a model that was read from a file can be asked without harm."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator
from sklearn.ensemble import (
    BaseEnsemble,
    GradientBoostingClassifier,
    HistGradientBoostingClassifier,
    HistGradientBoostingRegressor,
)
from sklearn.tree import BaseDecisionTree
from sklearn.tree._tree import Tree
from sklearn.utils.validation import check_is_fitted

from reliability.classifier import TransitionReliabilityClassifier
from reliability.fast_inference.scaling import SCALERS, check_scaler
from reliability.fast_inference.trees import check_boosting_nodes, check_tree_nodes
from reliability.network_checks import check_network
from systems.validation import is_integer

_MOST_FEATURES = 10**7
_MOST_JOBS = 1024
_MOST_DEGREE = 1000
_MOST_DRAWN = 624  # numbers that a Mersenne Twister holds


class _Part(NamedTuple):
    """An object within a model, the estimator that holds it, and the width of that one's rows."""

    thing: Any
    holder: BaseEstimator | None
    n_features: int | None


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
    for part in _parts(model):
        for kind, check in _CHECKS:
            if isinstance(part.thing, kind):
                check(part)
    _check_answer(model)


def _parts(model: Any) -> Iterator[_Part]:
    """Yield the objects within a model."""
    waiting, seen = [_Part(model, None, None)], {id(model)}
    while waiting:
        part = waiting.pop()
        if isinstance(part.thing, BaseEstimator):
            part = part._replace(n_features=_n_features(part))
        yield part
        for thing in _held_by(part.thing):
            if id(thing) not in seen:
                seen.add(id(thing))
                waiting.append(_within(part, thing))


def _within(part: _Part, thing: Any) -> _Part:
    if not isinstance(part.thing, BaseEstimator):
        return _Part(thing, part.holder, part.n_features)
    # A part of an ensemble is asked about the ensemble's rows and not about rows of its own.
    is_asked_the_same = isinstance(part.thing, BaseEnsemble | BaseDecisionTree)
    return _Part(thing, part.thing, part.n_features if is_asked_the_same else None)


def _held_by(thing: Any) -> Any:
    if isinstance(thing, dict):
        return list(thing.values())
    if isinstance(thing, list | tuple | set):
        return thing
    if isinstance(thing, np.ndarray):
        return thing.ravel().tolist() if thing.dtype.hasobject else ()
    return list(vars(thing).values()) if hasattr(thing, "__dict__") else ()


def _n_features(part: _Part) -> int | None:
    count, name = vars(part.thing).get("n_features_in_"), type(part.thing).__name__
    if count is None:
        return part.n_features
    if not is_integer(count) or not 0 < count <= _MOST_FEATURES:
        raise ValueError(f"{name}.n_features_in_ is {count!r}")
    return int(count) if part.n_features is None else min(int(count), part.n_features)


def _check_amounts(part: _Part) -> None:
    """Raise if an estimator's attributes ask for more memory, time or processes than a model."""
    for name, value in vars(part.thing).items():
        if not is_integer(value):
            continue
        if name == "n_jobs":
            most = _MOST_JOBS
        elif "degree" in name:
            most = _MOST_DEGREE
        elif name.lstrip("_").startswith("n_") and "samples" not in name and "iter" not in name:
            most = _MOST_FEATURES
        else:
            continue
        if abs(int(value)) > most:
            raise ValueError(f"{type(part.thing).__name__}.{name} is {value}")


def _check_tree(part: _Part) -> None:
    if not isinstance(part.holder, BaseDecisionTree) or part.n_features is None:
        raise ValueError("a tree is held by something else than a decision tree")
    check_tree_nodes(part.thing, part.n_features, type(part.holder).__name__)
    if not np.isfinite(part.thing.value).all():
        raise ValueError("a value of a tree is not finite")


def _check_boosting(part: _Part) -> None:
    model, name = part.thing, type(part.thing).__name__
    if "_predictors" not in vars(model):
        return
    if not isinstance(model._predictors, list) or part.n_features is None:
        raise ValueError(f"{name} has no trees")
    if vars(model).get("_preprocessor") is not None:
        raise ValueError(f"{name} splits by categorical features, which can't be checked.")
    trees = [tree.nodes for of_iteration in model._predictors for tree in of_iteration]
    check_boosting_nodes(trees, part.n_features, name)
    if not np.isfinite(np.concatenate(trees)["value"]).all():
        raise ValueError("a value of a tree is not finite")


def _check_stages(part: _Part) -> None:
    if "estimators_" not in vars(part.thing):
        return
    trees = np.asarray(part.thing.estimators_, dtype=object)
    if trees.ndim != 2 or trees.shape[1] != part.thing.n_trees_per_iteration_:
        raise ValueError("there are more trees in a stage than are summed")


def _check_network(part: _Part) -> None:
    if "_inference" in vars(part.thing):
        check_network(part.thing)


def _check_scaling(part: _Part) -> None:
    if "n_features_in_" in vars(part.thing):
        check_scaler(part.thing)


def _check_random_numbers(part: _Part) -> None:
    numbers = part.thing
    is_old = isinstance(numbers, np.random.RandomState)
    state = numbers.get_state(legacy=False) if is_old else numbers.bit_generator.state
    known = state["bit_generator"] in ("MT19937", "PCG64", "PCG64DXSM")
    if not known or not 0 <= state["state"].get("pos", 0) <= _MOST_DRAWN:
        raise ValueError("a random generator is in a state that it can't come to")


def _check_answer(model: Any) -> None:
    check_is_fitted(model)
    n_features = model.n_features_in_
    if not is_integer(n_features) or not 0 < n_features <= _MOST_FEATURES:
        raise ValueError(f"{type(model).__name__}.n_features_in_ is {n_features!r}")
    dtype = np.uint8 if getattr(model, "_packed", False) else np.float64
    row: NDArray[Any] = np.zeros((1, int(n_features)), dtype)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # This row has no names.
        _check_answers_for(model, row)


def _check_answers_for(model: Any, row: NDArray[Any]) -> None:
    answer = np.asarray(model.predict(row))
    if answer.shape != (1,) or answer[0] not in model.classes_:
        raise ValueError(f"predict gives {answer!r} for one row")
    if hasattr(model, "predict_proba") and np.shape(model.predict_proba(row)) != (
        1,
        len(model.classes_),
    ):
        raise ValueError("predict_proba gives other than one column for each class")
    for method in ("predict_proba", "decision_function"):
        if hasattr(model, method) and not np.isfinite(getattr(model, method)(row)).all():
            raise ValueError(f"{method} gives NaN")


_CHECKS: tuple[tuple[Any, Callable[[_Part], None]], ...] = (
    (BaseEstimator, _check_amounts),
    (Tree, _check_tree),
    (HistGradientBoostingClassifier | HistGradientBoostingRegressor, _check_boosting),
    (GradientBoostingClassifier, _check_stages),
    (TransitionReliabilityClassifier, _check_network),
    (SCALERS, _check_scaling),
    (np.random.Generator | np.random.RandomState, _check_random_numbers),
)
