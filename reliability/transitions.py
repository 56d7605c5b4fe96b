"""Labelled transitions: what is collected, stored and learned from."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reliability.archive import read_arrays, write_arrays
from reliability.labels import RELIABLE, UNRELIABLE
from reliability.named_features import as_table
from reliability.scenes import SceneArgument, SceneFamily
from reliability.transition_columns import as_integers, checked_columns, ids_apart
from reliability.trimmed_rows import ARRAYS, TrimmedRows, as_bits
from systems.features.names import feature_names
from systems.system import System
from systems.validation import as_finite_array, check_count

FORMAT_VERSION = 3

_COLUMNS = ("command", "y", "plan", "step", "scene", "executed")
_DESCRIBED_AT_ONCE = 2**15


class Transitions:
    """Transitions of many executed plans, one per row.

    Reduced states are stored once where a transition begins in the state in which the previous
    row ended, and a band that is shorter than its row is stored without the repeats of its last
    point; ``reduced`` and ``next_reduced`` are put together when they are asked for. Where there
    are many rows, select some first.

    Parameters
    ----------
    reduced : ndarray of shape (n, reduced_dim)
        b.
    command : ndarray of shape (n, command_dim)
        u.
    next_reduced : ndarray of shape (n, reduced_dim)
        b' = g(b, u).
    y : ndarray of int of shape (n,)
        RELIABLE (1) or UNRELIABLE (0).
    plan : ndarray of int of shape (n,)
        Which plan the transition belongs to: the groups for splitting data.
    step : ndarray of int of shape (n,)
        Position within its plan, from 0.
    scene : ndarray of int of shape (n,), default=None
        Which system of a family the plan was made in, as :func:`collect_transitions` numbers
        them: 0 for a single system, the position in a sequence, or the seed that was given to a
        callable. None is 0 everywhere.
    executed : ndarray of bool of shape (n,), default=None
        Where b is. False: where the plan had the system, labelled by Eq. 3. True: where the
        true system was when it was given u, labelled by
        :func:`reliability.label_executed_transitions`. None is False everywhere.

    Raises
    ------
    ValueError
        If the arrays don't fit together, a state or command is not a finite number, or a label
        is neither 1 nor 0.
    """

    def __init__(
        self,
        reduced: ArrayLike,
        command: ArrayLike,
        next_reduced: ArrayLike,
        y: ArrayLike,
        plan: ArrayLike,
        step: ArrayLike,
        scene: ArrayLike | None = None,
        executed: ArrayLike | None = None,
    ) -> None:
        before = as_finite_array(reduced, "reduced", (None, None))
        n, width = before.shape
        after = as_finite_array(next_reduced, "next_reduced", (n, width))
        none = np.zeros(n, dtype=np.int64)
        columns = {
            "command": as_finite_array(command, "command", (n, None)),
            "y": y,
            "plan": plan,
            "step": step,
            "scene": none if scene is None else scene,
            "executed": none.astype(np.bool_) if executed is None else executed,
        }
        self._set_columns(checked_columns(columns, n))
        follows_on = np.zeros(n, dtype=np.bool_)
        follows_on[:-1] = (as_bits(after[:-1]) == as_bits(before[1:])).all(axis=1)
        both = np.stack([before, after], axis=1)
        kept = np.stack([np.ones_like(follows_on), ~follows_on], axis=1)
        self._states = TrimmedRows.pack(both[kept])
        self._first = _first_states(follows_on)

    def _set_columns(self, columns: dict[str, NDArray[Any]]) -> None:
        self.command: NDArray[np.float64] = columns["command"]
        self.y: NDArray[np.int64] = columns["y"]
        self.plan: NDArray[np.int64] = columns["plan"]
        self.step: NDArray[np.int64] = columns["step"]
        self.scene: NDArray[np.int64] = columns["scene"]
        self.executed: NDArray[np.bool_] = columns["executed"]

    @classmethod
    def _of_states(
        cls, states: TrimmedRows, first: NDArray[np.int64], columns: dict[str, NDArray[Any]]
    ) -> Transitions:
        made = cls.__new__(cls)
        made._states, made._first = states, first
        made._set_columns(columns)
        return made

    def _columns(self) -> dict[str, NDArray[Any]]:
        return {name: getattr(self, name) for name in _COLUMNS}

    @property
    def reduced(self) -> NDArray[np.float64]:
        """The states b of each transition, shape (n, reduced_dim).

        With scenes of different ``reduced_dim``, the largest; the last point of the others is
        repeated. Select the rows of one scene to give them to its system.
        """
        return self._states.unpack(self._first)

    @property
    def next_reduced(self) -> NDArray[np.float64]:
        """The states b' of each transition, shape (n, reduced_dim), like ``reduced``."""
        return self._states.unpack(self._first + 1)

    @property
    def nbytes(self) -> int:
        """Bytes that the transitions take up in memory."""
        return sum(array.nbytes for array in self.to_arrays().values())

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
        columns = {name: column[index] for name, column in self._columns().items()}
        states = self._states.take(pairs[kept])
        return self._of_states(states, _first_states(follows_on), columns)

    def __repr__(self) -> str:
        dims = np.unique(np.append(self._states.widths, self._states.width)).tolist()
        if not len(self):
            return f"<Transitions: none, reduced_dim {dims[0]}>"
        dim = str(dims[0]) if len(dims) == 1 else f"{dims[0]} to {dims[-1]}"
        n_plans, n_scenes = len(np.unique(self.plan)), len(np.unique(self.scene))
        return (
            f"<Transitions: {_counted(len(self), 'transition')} of {_counted(n_plans, 'plan')} in "
            f"{_counted(n_scenes, 'scene')}, {np.mean(self.y == UNRELIABLE):.1%} Unreliable, "
            f"reduced_dim {dim}, command_dim {self.command.shape[1]}>"
        )

    def trim_unreliable_runs(self, n_after: int) -> Transitions:
        """Leave out what each plan did long after its execution had diverged.

        Once an execution has diverged, all that follows is Unreliable by Eq. 3, whatever it is,
        until the system happens to be where the plan has it again. Such rows tell where executions
        are that diverged earlier, and not what makes them diverge. Rows that are labelled from
        executed states are all kept.

        Parameters
        ----------
        n_after : int
            How many of each plan's Unreliable transitions in a row to keep, the first ones. With
            1, what is kept is what is Reliable and :meth:`divergence_onsets`.

        Returns
        -------
        transitions : Transitions
        """
        check_count(n_after, "n_after")
        begins = np.flatnonzero((self.y == RELIABLE) | self.divergence_onsets())
        rows = np.arange(len(self))
        n_before = rows - begins[np.searchsorted(begins, rows, side="right") - 1]
        return self[n_before < n_after]

    @classmethod
    def concatenate(cls, parts: Sequence[Transitions]) -> Transitions:
        """Join transitions end to end, and keep the plans of different parts apart.

        Plan ids are kept where they differ between all parts. The plans of a part that shares an
        id with an earlier one are numbered anew, in order, after the greatest id so far. Scene
        ids are kept as they are, so that :meth:`features` goes on to understand them: join
        transitions of the same system, sequence or callable.

        Parameters
        ----------
        parts : sequence of Transitions
            At least one. Rows of one plan that are in several parts become several plans.

        Returns
        -------
        transitions : Transitions
        """
        joined = join(parts)
        joined.plan = np.concatenate(ids_apart([part.plan for part in parts]))
        return joined

    @overload
    def features(
        self, system: SceneArgument, *, as_frame: Literal[False] = False
    ) -> NDArray[Any]: ...

    @overload
    def features(self, system: SceneArgument, *, as_frame: Literal[True]) -> Any: ...

    def features(self, system: SceneArgument, *, as_frame: bool = False) -> Any:
        """Describe the transitions to an estimator, each in its scene.

        Parameters
        ----------
        system : System, sequence of Systems, or callable ``random_state -> System``
            What the transitions were collected from, or the same scenes with other features. A
            single system describes all rows, which must then be of one scene.
        as_frame : bool, default=False
            Return a pandas DataFrame, whose columns are called as the system's
            ``feature_names_out`` says.

        Returns
        -------
        X : ndarray or DataFrame of shape (n, n_features)

        Raises
        ------
        ValueError
            If the transitions are of scenes that ``system`` does not have, or a table is asked
            for and the system does not say what its features are called.
        ImportError
            If a table is asked for and pandas is not installed.
        """
        X, names = named_features(self, system)
        if not as_frame:
            return X
        if names is None:
            raise ValueError(
                "as_frame=True needs names of the features, and system does not say what they are "
                f"called: give it feature_names_out, a sequence of {X.shape[1]} strings."
            )
        return as_table(X, names)

    def _described(self, system: System, rows: NDArray[np.int64]) -> NDArray[Any]:
        first = self._first[rows]
        return system.features(self._states.unpack(first), self._states.unpack(first + 1))

    def divergence_onsets(self) -> NDArray[np.bool_]:
        """Mark each Unreliable transition at which an execution and its plan diverge.

        These are the Unreliable transitions that follow a Reliable one of the same plan, or begin
        their plan; the other Unreliable ones come after. Where labels are from executed states,
        each Unreliable transition is marked, since its prediction began where the system was.

        Returns
        -------
        mask : ndarray of bool of shape (n,)
        """
        follows = np.zeros(len(self), dtype=np.bool_)
        follows[1:] = (self.plan[1:] == self.plan[:-1]) & (self.step[1:] == self.step[:-1] + 1)
        follows[1:] &= self.executed[1:] == self.executed[:-1]
        had_diverged = np.zeros(len(self), dtype=np.bool_)
        had_diverged[1:] = follows[1:] & (self.y[:-1] == UNRELIABLE)
        return (self.y == UNRELIABLE) & (self.executed | ~had_diverged)

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that a file of these transitions holds."""
        return {**self._columns(), **self._states.to_arrays(), "first": self._first}

    @classmethod
    def from_arrays(cls, arrays: dict[str, NDArray[Any]]) -> Transitions:
        """Make transitions of what :meth:`to_arrays` returned.

        Raises
        ------
        ValueError
            If the arrays don't belong together.
        """
        states = TrimmedRows.from_arrays(arrays)
        first = as_integers(arrays["first"], "first", len(arrays["y"]))
        if len(first) and not (first.min() >= 0 and first.max() < len(states) - 1):
            raise ValueError(f"first must number states of {len(states)} that another follows.")
        columns = {name: arrays[name] for name in _COLUMNS}
        columns["command"] = as_finite_array(columns["command"], "command", (len(first), None))
        return cls._of_states(states, first, checked_columns(columns, len(first)))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write one npz file; whatever stood there is replaced only when all is written.

        Raises
        ------
        ValueError
            If a column was replaced by one that does not belong here, which :meth:`load` refuses.
        """
        arrays = self.to_arrays()
        self.from_arrays(arrays)
        write_arrays(path, arrays, format_version=FORMAT_VERSION)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Transitions:
        """Read a file that :meth:`save` wrote.

        Raises
        ------
        ValueError
            If the file is no such file, is truncated or damaged, has another format version, or
            holds arrays that don't belong together.
        """
        names = {"first", *_COLUMNS, *ARRAYS}
        arrays = read_arrays(path, names, format_version=FORMAT_VERSION, kind="transitions")
        try:
            return cls.from_arrays(arrays)
        except ValueError as error:
            raise ValueError(f"{path} is not a whole file of transitions ({error})") from error


def named_features(
    transitions: Transitions, system: SceneArgument
) -> tuple[NDArray[Any], tuple[str, ...] | None]:
    """Return the features of transitions and what they are called, None if that is not said."""
    family = SceneFamily(system)
    scenes = np.unique(transitions.scene) if len(transitions) else np.zeros(1, dtype=np.int64)
    family.check_ids(scenes)
    first = family.system(int(scenes[0]))
    none = first.features(*np.empty((2, 0, first.reduced_dim)))
    n_features = math.prod(none.shape[1:])
    names = feature_names(first, n_features)
    X = np.empty((len(transitions), *none.shape[1:]), dtype=none.dtype)
    for scene in scenes:
        described = family.system(int(scene))
        if feature_names(described, n_features) != names:
            raise ValueError(
                f"system calls the features of scenes {scenes[0]} and {scene} by different names."
            )
        rows = np.flatnonzero(transitions.scene == scene)
        # A million grids fit into memory once, not twice: parts are filled in, not joined.
        for begin in range(0, len(rows), _DESCRIBED_AT_ONCE):
            chunk = rows[begin : begin + _DESCRIBED_AT_ONCE]
            X[chunk] = transitions._described(described, chunk)
    return X, names


def join(parts: Sequence[Transitions]) -> Transitions:
    """Join transitions end to end, with their ids as they are."""
    are_parts = isinstance(parts, Sequence) and all(isinstance(p, Transitions) for p in parts)
    if not are_parts or not parts:
        raise ValueError(f"parts must be a sequence of at least one Transitions, got {parts!r}.")
    states = TrimmedRows.concatenate([part._states for part in parts])
    n_before = np.cumsum([0, *(len(part._states) for part in parts)])
    first = [part._first + n for part, n in zip(parts, n_before[:-1], strict=True)]
    columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _COLUMNS}
    return Transitions._of_states(states, np.concatenate(first), columns)


def _counted(n: int, noun: str) -> str:
    return f"{n:,} {noun}" + ("s" if n != 1 else "")


def _first_states(follows_on: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Index of the state that each transition begins in; it ends in the next."""
    n_ends: NDArray[np.int64] = np.cumsum(~follows_on) - ~follows_on
    return np.arange(len(follows_on)) + n_ends
