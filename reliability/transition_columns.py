"""Columns of transitions: labels and ids, checked and told apart."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reliability.labels import RELIABLE, UNRELIABLE
from systems.validation import MOST, as_any_array


def checked_columns(columns: dict[str, Any], n: int) -> dict[str, NDArray[Any]]:
    """Return the columns of ``n`` transitions as they are stored, or say what is wrong.

    Raises
    ------
    ValueError
        If labels are neither RELIABLE nor UNRELIABLE, ids are no integers, or a column has
        another length. ``command`` is returned as it is.
    """
    checked = {name: as_integers(columns[name], name, n) for name in ("y", "plan", "step", "scene")}
    wrong = checked["y"][(checked["y"] != RELIABLE) & (checked["y"] != UNRELIABLE)]
    if len(wrong):
        raise ValueError(
            f"y must hold {RELIABLE} for Reliable and {UNRELIABLE} for Unreliable, got {wrong[0]}."
        )
    executed = as_any_array(columns["executed"], "executed")
    if executed.dtype != np.bool_ or executed.shape != (n,):
        raise ValueError(
            f"executed must hold {n} bools, got {executed.dtype} of shape {executed.shape}."
        )
    return {**checked, "command": columns["command"], "executed": executed}


def as_integers(values: Any, name: str, n: int) -> NDArray[np.int64]:
    """Return ``n`` integers as int64, or raise ``ValueError`` naming what they are."""
    array = as_any_array(values, name)
    if array.shape != (n,):
        raise ValueError(f"{name} must have the shape ({n},), got {array.shape}.")
    if array.dtype.kind not in "biu" and len(array):
        raise ValueError(f"{name} must hold integers, got {array.dtype}, such as {array[0]!r}.")
    if len(array) and array.max() > MOST:
        raise ValueError(f"{name} must hold integers below 2**63, got {array.max()}.")
    return array.astype(np.int64, copy=False)


def ids_apart(ids: Sequence[NDArray[np.int64]]) -> list[NDArray[np.int64]]:
    """Return the ids of each part, numbered anew in order if an earlier part has one of them."""
    apart: list[NDArray[np.int64]] = []
    taken: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
    for part in ids:
        own, number = np.unique(part, return_inverse=True)
        if np.isin(own, taken).any():
            own = taken.max() + 1 + np.arange(len(own))
        taken = np.union1d(taken, own)
        apart.append(own[number])
    return apart
