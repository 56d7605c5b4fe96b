"""The classifier's backends: their own defaults, the rows they take, the parameters they allow."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reliability.voxel_format import LEAST_SIDE, SIDES, grid_shape
from systems.validation import check_count, check_number

_MLP = {
    "max_epochs": 25,
    "batch_size": 256,
    "learning_rate": 2e-3,
    "learning_rate_decay": 0.87,
    "epochs_per_decay": 1,
    "validation_fraction": 0.2,
    "balanced_batches": False,
}
_VOXNET = {
    "max_epochs": 100,
    "batch_size": 32,
    "learning_rate": 5e-4,
    "learning_rate_decay": 0.8,
    "epochs_per_decay": 4,
    "validation_fraction": 0.1,
    "balanced_batches": True,
}


def resolved(estimator: Any) -> dict[str, Any]:
    """Return the parameters of a classifier, with its backend's own in place of None."""
    defaults = _VOXNET if estimator.backend == "voxnet" else _MLP
    given = estimator.get_params(deep=False)
    return {name: defaults.get(name) if v is None else v for name, v in given.items()}


def check_parameters(parameters: dict[str, Any]) -> None:
    """Raise ``ValueError`` at the first parameter that is unfit."""
    backend = parameters["backend"]
    if backend not in ("mlp", "voxnet") and not isinstance(backend, type):
        raise ValueError(
            f'backend must be "mlp", "voxnet" or a class of torch modules, got {backend!r}.'
        )
    if not isinstance(parameters["hidden_layer_sizes"], tuple | list):
        raise ValueError(
            "hidden_layer_sizes must be a tuple of positive integers, "
            f"got {parameters['hidden_layer_sizes']!r}."
        )
    for size in parameters["hidden_layer_sizes"]:
        check_count(size, "Each of hidden_layer_sizes")
    for name in ("max_epochs", "batch_size", "epochs_per_decay"):
        check_count(parameters[name], name)
    for name in ("patience", "rows_per_epoch"):
        if parameters[name] is not None:
            check_count(parameters[name], name)
    check_number(parameters["learning_rate"], "learning_rate", 0, np.inf)
    check_number(parameters["learning_rate_decay"], "learning_rate_decay", 0, 1)
    check_number(parameters["validation_fraction"], "validation_fraction", 0, 1)
    check_count(parameters["pooling"], "pooling")
    if parameters["pooling"] not in (1, 2, 4):
        raise ValueError(f"pooling must be 1, 2 or 4, got {parameters['pooling']}.")
    if parameters["checkpoint"] is not None and parameters["random_state"] is None:
        raise ValueError(
            "checkpoint needs a random_state: without one, a training can't be begun again as it "
            "was. Pass an integer."
        )


def check_pooling(n_bytes: int, pooling: int) -> None:
    """Raise ``ValueError`` if packed rows hold no grids, or pooling leaves too little of them."""
    side = grid_shape(n_bytes)[1]
    if side // pooling < LEAST_SIDE:
        raise ValueError(
            f"pooling must leave at least {LEAST_SIDE} cells a side, got {pooling} for grids of "
            f"{side} (grids may have {', '.join(map(str, SIDES))})."
        )


def check_packed(X: Any, n_features: int) -> None:
    """Raise ``ValueError`` unless rows are packed as those that a model was trained on."""
    found = getattr(X, "dtype", type(X).__name__)
    if found != np.uint8:
        channels, side = grid_shape(n_features)
        raise ValueError(
            f"X must hold the bit-packed grids that this model was trained on, uint8 rows of "
            f"{n_features} bytes ({channels} channels of {side} x {side} x {side} cells), got "
            f"{found}."
        )


def row_types(estimator: Any) -> Any:
    """Return the types of number that a backend takes; the first is what others become."""
    return [np.float32, np.uint8] if estimator.backend == "voxnet" else np.float32


def accuracy(estimator: Any, X: NDArray[Any], truth: NDArray[Any], rows: NDArray[np.intp]) -> float:
    """Return the share of rows that are predicted right, taking some at a time; NaN for none."""
    if len(rows) == 0:
        return float("nan")
    parts = np.array_split(rows, -(-len(rows) // 16384))
    correct = sum(np.count_nonzero(estimator.predict(X[part]) == truth[part]) for part in parts)
    return float(correct / len(rows))
