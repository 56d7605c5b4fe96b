"""Labelled transitions: what is collected, stored and learned from."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reliability.labels import RELIABLE, UNRELIABLE
from systems.archive import read_arrays, write_arrays
from systems.system import System

FORMAT_VERSION = 1


@dataclass(frozen=True, eq=False)
class Transitions:
    """Transitions of many executed plans, one per row.

    Attributes
    ----------
    reduced : ndarray of shape (n, reduced_dim)
        b, as planned.
    command : ndarray of shape (n, command_dim)
        u.
    next_reduced : ndarray of shape (n, reduced_dim)
        b' = g(b, u), as planned.
    y : ndarray of int of shape (n,)
        RELIABLE or UNRELIABLE.
    plan : ndarray of int of shape (n,)
        Which plan the transition belongs to: the groups for splitting data.
    step : ndarray of int of shape (n,)
        Position within its plan, from 0.
    """

    reduced: NDArray[np.float64]
    command: NDArray[np.float64]
    next_reduced: NDArray[np.float64]
    y: NDArray[np.int64]
    plan: NDArray[np.int64]
    step: NDArray[np.int64]

    def __post_init__(self) -> None:
        for field in fields(self):
            array = getattr(self, field.name)
            n_dims = 2 if field.name in ("reduced", "command", "next_reduced") else 1
            if not isinstance(array, np.ndarray) or array.ndim != n_dims:
                raise ValueError(f"{field.name} must be an array of {n_dims} dimensions.")
            if len(array) != len(self.reduced):
                raise ValueError(
                    f"{field.name} must have a row per transition, {len(self.reduced)}, "
                    f"got {len(array)}."
                )

    def __len__(self) -> int:
        return len(self.reduced)

    def __getitem__(self, rows: Any) -> Transitions:
        """Select rows by a slice, a mask or an array of indices."""
        index = np.arange(len(self))[rows]
        if index.ndim != 1:
            raise IndexError(f"Transitions are selected by slice, mask or array, got {rows!r}.")
        return Transitions(*(getattr(self, field.name)[rows] for field in fields(self)))

    @classmethod
    def concatenate(cls, parts: Sequence[Transitions]) -> Transitions:
        """Join transitions end to end; plan ids are kept as they are."""
        if not parts:
            raise ValueError("parts must hold at least one Transitions, got none.")
        return cls(
            *(
                np.concatenate([getattr(part, field.name) for part in parts])
                for field in fields(cls)
            )
        )

    def features(self, system: System) -> NDArray[Any]:
        """Describe the transitions to an estimator, as ``system`` sees them.

        Returns
        -------
        X : ndarray of shape (n, n_features)
        """
        return system.features(self.reduced, self.next_reduced)

    def first_mistakes(self) -> NDArray[np.bool_]:
        """Tell where execution and prediction part, from where they had already parted.

        Returns
        -------
        mask : ndarray of bool of shape (n,)
            Unreliable transitions that follow a Reliable one or begin their plan.
        """
        follows = np.zeros(len(self), dtype=np.bool_)
        follows[1:] = (self.plan[1:] == self.plan[:-1]) & (self.step[1:] == self.step[:-1] + 1)
        was_reliable = np.ones(len(self), dtype=np.bool_)
        was_reliable[1:] = ~follows[1:] | (self.y[:-1] == RELIABLE)
        return (self.y == UNRELIABLE) & was_reliable

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write one npz file; whatever stood there is replaced only when all is written."""
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        write_arrays(path, arrays, format_version=FORMAT_VERSION)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Transitions:
        """Read a file that :meth:`save` wrote.

        Raises
        ------
        ValueError
            If the file is no such file, is truncated, or has another format version.
        """
        names = {field.name for field in fields(cls)}
        arrays = read_arrays(path, names, format_version=FORMAT_VERSION, kind="transitions")
        return cls(**arrays)
