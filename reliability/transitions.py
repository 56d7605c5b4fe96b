"""Labelled transitions: what is collected, stored and learned from."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reliability.archive import read_arrays, write_arrays
from reliability.labels import RELIABLE, UNRELIABLE
from reliability.trimmed_rows import TrimmedRows, as_bits
from systems.system import System
from systems.validation import check_count

FORMAT_VERSION = 2

_OTHERS = ("command", "next_reduced", "y", "plan", "step")
_COLUMNS = ("command", "y", "plan", "step")
_STATES = ("values", "lengths", "width")
_DESCRIBED_AT_ONCE = 2**15


class Transitions:
    """Transitions of many executed plans, one per row.

    Reduced states are stored once where a transition begins in the state that the one before
    ended in, and without a band's repeats of its last point; ``reduced`` and ``next_reduced``
    are made when asked for. Select rows first where there are many.

    Parameters
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

    def __init__(
        self,
        reduced: NDArray[np.float64],
        command: NDArray[np.float64],
        next_reduced: NDArray[np.float64],
        y: NDArray[np.int64],
        plan: NDArray[np.int64],
        step: NDArray[np.int64],
    ) -> None:
        _check_lengths(reduced, command, next_reduced, y, plan, step)
        self.command, self.y, self.plan, self.step = command, y, plan, step
        follows_on = np.zeros(len(reduced), dtype=np.bool_)
        ends, starts = as_bits(next_reduced[:-1]), as_bits(reduced[1:])
        follows_on[:-1] = (ends == starts).all(axis=1)
        both = np.stack([reduced, next_reduced], axis=1)
        kept = np.stack([np.ones_like(follows_on), ~follows_on], axis=1)
        self._states = TrimmedRows.pack(both[kept])
        self._first = _first_states(follows_on)

    @classmethod
    def _of_states(
        cls, states: TrimmedRows, first: NDArray[np.int64], columns: dict[str, NDArray[Any]]
    ) -> Transitions:
        made = cls.__new__(cls)
        made._states, made._first = states, first
        for name in _COLUMNS:
            setattr(made, name, columns[name])
        return made

    @property
    def reduced(self) -> NDArray[np.float64]:
        """The states b of each transition, shape (n, reduced_dim)."""
        return self._states.unpack(self._first)

    @property
    def next_reduced(self) -> NDArray[np.float64]:
        """The states b' of each transition, shape (n, reduced_dim)."""
        return self._states.unpack(self._first + 1)

    @property
    def nbytes(self) -> int:
        """Bytes that the transitions take up in memory."""
        stored = (self._states.values, self._states.lengths, self._first)
        columns = (getattr(self, name) for name in _COLUMNS)
        return sum(array.nbytes for array in (*stored, *columns))

    def __len__(self) -> int:
        return len(self._first)

    def __getitem__(self, rows: Any) -> Transitions:
        """Select rows by a slice, a mask or an array of indices."""
        index = np.arange(len(self))[rows]
        if index.ndim != 1:
            raise IndexError(f"Transitions are selected by slice, mask or array, got {rows!r}.")
        first = self._first[index]
        follows_on = np.zeros(len(index), dtype=np.bool_)
        follows_on[:-1] = first[1:] == first[:-1] + 1
        pairs = np.stack([first, first + 1], axis=1)
        kept = np.stack([np.ones_like(follows_on), ~follows_on], axis=1)
        columns = {name: getattr(self, name)[index] for name in _COLUMNS}
        states = self._states.take(pairs[kept])
        return self._of_states(states, _first_states(follows_on), columns)

    def trim_unreliable_tail(self, n_after: int) -> Transitions:
        """Leave out what each plan did long after its execution went astray for good.

        From the mistake on that an execution never recovers from, all is Unreliable, whatever it
        is: it says where executions are that went wrong before, and not what makes them go wrong.

        Parameters
        ----------
        n_after : int
            Transitions to keep of those that end a plan and are all Unreliable, the first ones.

        Returns
        -------
        transitions : Transitions
        """
        check_count(n_after, "n_after")
        _, plan = np.unique(self.plan, return_inverse=True)
        last = np.full(plan.max(initial=-1) + 1, -1)
        np.maximum.at(last, plan, np.where(self.y == RELIABLE, self.step, -1))
        return self[self.step <= last[plan] + n_after]

    @classmethod
    def concatenate(cls, parts: Sequence[Transitions]) -> Transitions:
        """Join transitions end to end; plan ids are kept as they are."""
        if not parts:
            raise ValueError("parts must hold at least one Transitions, got none.")
        states = TrimmedRows.concatenate([part._states for part in parts])
        n_before = np.cumsum([0, *(len(part._states) for part in parts)])
        first = [part._first + n for part, n in zip(parts, n_before[:-1], strict=True)]
        columns = {
            name: np.concatenate([getattr(part, name) for part in parts]) for name in _COLUMNS
        }
        return cls._of_states(states, np.concatenate(first), columns)

    def features(self, system: System) -> NDArray[Any]:
        """Describe the transitions to an estimator, as ``system`` sees them.

        Returns
        -------
        X : ndarray of shape (n, n_features)
        """
        # A million grids fit into memory once, not twice: parts are not joined but filled in.
        none = self._described(system, slice(0, 0))
        X = np.empty((len(self), *none.shape[1:]), dtype=none.dtype)
        for first in range(0, len(self), _DESCRIBED_AT_ONCE):
            rows = slice(first, first + _DESCRIBED_AT_ONCE)
            X[rows] = self._described(system, rows)
        return X

    def _described(self, system: System, rows: slice) -> NDArray[Any]:
        first = self._first[rows]
        return system.features(self._states.unpack(first), self._states.unpack(first + 1))

    def divergence_onsets(self) -> NDArray[np.bool_]:
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
        arrays = {name: getattr(self, name) for name in _COLUMNS}
        states = {name: getattr(self._states, name) for name in _STATES}
        write_arrays(path, arrays | states | {"first": self._first}, format_version=FORMAT_VERSION)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Transitions:
        """Read a file that :meth:`save` wrote.

        Raises
        ------
        ValueError
            If the file is no such file, is truncated, or has another format version.
        """
        names = {"first", *_COLUMNS, *_STATES}
        arrays = read_arrays(path, names, format_version=FORMAT_VERSION, kind="transitions")
        states = TrimmedRows(arrays["values"], arrays["lengths"], int(arrays["width"]))
        return cls._of_states(states, arrays["first"], arrays)


def _check_lengths(reduced: Any, *others: Any) -> None:
    for name, array in zip(("reduced", *_OTHERS), (reduced, *others), strict=True):
        n_dims = 2 if name in ("reduced", "command", "next_reduced") else 1
        if not isinstance(array, np.ndarray) or array.ndim != n_dims:
            raise ValueError(f"{name} must be an array of {n_dims} dimensions.")
        if len(array) != len(reduced):
            raise ValueError(
                f"{name} must have a row per transition, {len(reduced)}, got {len(array)}."
            )


def _first_states(follows_on: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Index of the state that each transition begins in; it ends in the next."""
    n_ends: NDArray[np.int64] = np.cumsum(~follows_on) - ~follows_on
    return np.arange(len(follows_on)) + n_ends
