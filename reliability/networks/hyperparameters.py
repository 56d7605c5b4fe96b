"""Hyperparameters: how a network is trained."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from systems.validation import check_count, check_flag, check_number, is_integer, is_number

_COUNTS = ("max_epochs", "batch_size", "epochs_per_decay", "rows_per_epoch")


@dataclass(frozen=True)
class Hyperparameters:
    """How a network is trained; the fields are the classifier's parameters of the same names."""

    max_epochs: int
    batch_size: int
    learning_rate: float
    learning_rate_decay: float
    epochs_per_decay: int
    validation_fraction: float
    balanced_batches: bool
    patience: int | bool
    rows_per_epoch: int | None = None

    def overridden_by(self, classifier: Any) -> Hyperparameters:
        """Return these with the classifier's own values in place of those that it gives.

        Parameters
        ----------
        classifier : TransitionReliabilityClassifier
            A parameter of None is not given.

        Raises
        ------
        ValueError
            If a value is out of range; the message names the parameter.
        """
        values = {field.name: getattr(classifier, field.name) for field in fields(self)}
        given = {name: value for name, value in values.items() if value is not None}
        _check(given)
        # Plain numbers: np.uint8(200) + 100 overflows, and np.float64(0.1) prints as another text.
        return replace(self, **{name: as_plain(value) for name, value in given.items()})


def as_plain(value: Any) -> Any:
    """Return an int or float for any other number; a list or tuple becomes a tuple of such."""
    if isinstance(value, list | tuple):
        return tuple(as_plain(item) for item in value)
    plain = value.item() if isinstance(value, np.generic) else value
    return float(plain) if is_number(plain) and not is_integer(plain) else plain


def _check(given: dict[str, Any]) -> None:
    for name in _COUNTS:
        if name in given:
            check_count(given[name], name)
    if not _is_false(given.get("patience", False)):
        check_count(given["patience"], "patience")
    if "learning_rate" in given:
        check_number(given["learning_rate"], "learning_rate", 0, np.inf)
        if given["learning_rate"] == np.inf:
            raise ValueError("learning_rate must be finite, got inf.")
    for name in ("learning_rate_decay", "validation_fraction"):
        if name in given:
            check_number(given[name], name, 0, 1)
    if "balanced_batches" in given:
        check_flag(given["balanced_batches"], "balanced_batches")


def _is_false(value: Any) -> bool:
    return isinstance(value, bool | np.bool_) and not value
