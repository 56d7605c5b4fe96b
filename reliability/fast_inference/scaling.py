"""The arithmetic of scikit-learn's scalers, compiled."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sklearn.preprocessing import MaxAbsScaler, MinMaxScaler, RobustScaler, StandardScaler

from reliability.fast_inference.scaling_kernel import scaled_rows
from reliability.fast_inference.tree_kernels import holds_unfit

Transform = Callable[[NDArray[Any]], NDArray[Any]]
SCALERS = (StandardScaler, MinMaxScaler, RobustScaler, MaxAbsScaler)


class _Scaling(NamedTuple):
    """The arguments of :func:`scaled_rows` that a fitted scaler stands for."""

    subtract: NDArray[Any]
    divide: NDArray[Any]
    multiply: NDArray[Any]
    add: NDArray[Any]
    low: float = -np.inf
    high: float = np.inf


def compile_scaler(scaler: Any) -> Transform | None:
    """Return the ``transform`` of a fitted scaler as a quick function.

    Parameters
    ----------
    scaler : StandardScaler, MinMaxScaler, RobustScaler or MaxAbsScaler

    Returns
    -------
    transform : callable or None
        Maps rows to rows; raises ``ValueError`` for infinite values, as the scaler does. None if
        this version of scikit-learn computes in a way that is not known here.
    """
    kind: Any = type(scaler)
    casts = _casts_parameters(kind)
    if casts is None:
        return None
    check_scaler(scaler)
    double = _scaling(scaler)
    single = _cast(double) if casts else double
    name, n_features = kind.__name__, scaler.n_features_in_

    def transform(rows: NDArray[Any]) -> NDArray[Any]:
        if rows.shape[1] != n_features:
            raise ValueError(f"{name} was fitted on {n_features} features, got {rows.shape[1]}.")
        # scikit-learn keeps single precision, and makes double precision of whole numbers.
        is_single = rows.dtype == np.float32
        known = np.ascontiguousarray(rows, dtype=np.float32 if is_single else np.float64)
        if holds_unfit(known, True):
            raise ValueError(f"{name} was asked about features that are infinite.")
        scaled: NDArray[Any] = scaled_rows(known, *(single if is_single else double))
        return scaled

    return transform


def check_scaler(scaler: Any) -> None:
    """Raise ``ValueError`` unless a fitted scaler has one number for each feature, if any.

    Parameters
    ----------
    scaler : StandardScaler, MinMaxScaler, RobustScaler or MaxAbsScaler
    """
    name, n_features = type(scaler).__name__, scaler.n_features_in_
    for array in _scaling(scaler)[:4]:
        if np.shape(array) != (n_features,) or np.asarray(array).dtype.kind != "f":
            raise ValueError(f"{name} is damaged: it has not one number for each feature.")


@cache
def _casts_parameters(kind: Any) -> bool | None:
    """Say whether a scaler rounds its parameters to the precision of the rows before using them.

    That depends on scikit-learn's version, so a scaler is fitted and asked. None if its answers
    are neither.
    """
    rows = 3 + np.random.default_rng(0).normal(size=(256, 1))
    scaler = kind().fit(rows)
    scaling, narrow = _scaling(scaler), rows.astype(np.float32)
    if not np.array_equal(scaled_rows(rows, *scaling), scaler.transform(rows)):
        return None
    expected = scaler.transform(narrow)
    for casts, parameters in ((True, _cast(scaling)), (False, scaling)):
        if np.array_equal(scaled_rows(narrow, *parameters), expected):
            return casts
    return None


def _cast(scaling: _Scaling) -> _Scaling:
    names = ("subtract", "divide", "multiply", "add")
    return scaling._replace(**{name: getattr(scaling, name).astype(np.float32) for name in names})


def _scaling(scaler: Any) -> _Scaling:
    zeros, ones = np.zeros(scaler.n_features_in_), np.ones(scaler.n_features_in_)
    if isinstance(scaler, StandardScaler):
        mean = scaler.mean_ if scaler.with_mean else zeros
        return _Scaling(mean, scaler.scale_ if scaler.with_std else ones, ones, zeros)
    if isinstance(scaler, RobustScaler):
        center = scaler.center_ if scaler.with_centering else zeros
        return _Scaling(center, scaler.scale_ if scaler.with_scaling else ones, ones, zeros)
    if isinstance(scaler, MinMaxScaler):
        bounds = scaler.feature_range if scaler.clip else (-np.inf, np.inf)
        return _Scaling(zeros, ones, scaler.scale_, scaler.min_, *map(float, bounds))
    bounds = (-1.0, 1.0) if getattr(scaler, "clip", False) else (-np.inf, np.inf)
    return _Scaling(zeros, scaler.scale_, ones, zeros, *bounds)
