"""Rows that end in repeats, kept without them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.validation import as_finite_array

# Coordinates of a point: a band that is shorter than its row repeats its last point.
PERIOD = 3
# Far above any reduced state; a file that claims more would fill the memory when it is unpacked.
LARGEST_WIDTH = 100_000
ARRAYS = ("values", "lengths", "widths", "width")


@dataclass(frozen=True, eq=False)
class TrimmedRows:
    """Rows of numbers, each stored up to where its last three begin to repeat.

    Nothing is lost: the rows come back bit by bit.

    Attributes
    ----------
    values : ndarray of shape (n_values,)
        The rows one after another.
    lengths : ndarray of int of shape (n_rows,)
        How many numbers of each row are stored.
    widths : ndarray of int of shape (n_rows,)
        How many numbers each whole row has.
    width : int
        The width of no rows.
    """

    values: NDArray[np.float64]
    lengths: NDArray[np.int32]
    widths: NDArray[np.int32]
    width: int

    def __len__(self) -> int:
        return len(self.lengths)

    @classmethod
    def pack(cls, rows: NDArray[np.float64]) -> TrimmedRows:
        """Pack rows of shape (n_rows, width)."""
        bits = as_bits(rows)
        width = bits.shape[1]
        if width > LARGEST_WIDTH:
            raise ValueError(f"rows must be {LARGEST_WIDTH} numbers wide at most, got {width}.")
        differs = np.ones((len(bits), max(width - PERIOD, 0) + 1), dtype=np.bool_)
        differs[:, 1:] = bits[:, PERIOD:] != bits[:, :-PERIOD]
        lengths = (width - np.argmax(differs[:, ::-1], axis=1)).astype(np.int32)
        kept = np.arange(width) < lengths[:, None]
        widths = np.full(len(bits), width, dtype=np.int32)
        return cls(np.asarray(rows, dtype=np.float64)[kept], lengths, widths, width)

    @classmethod
    def from_arrays(cls, arrays: dict[str, NDArray[Any]]) -> TrimmedRows:
        """Put together what :meth:`to_arrays` returned.

        Raises
        ------
        ValueError
            If the arrays don't belong together.
        """
        values, lengths, widths, width = (arrays[name] for name in ARRAYS)
        _check_kind(values, "values", np.float64, 1)
        _check_kind(lengths, "lengths", np.int32, 1)
        _check_kind(widths, "widths", np.int32, 1)
        _check_kind(width, "width", np.int64, 0)
        if len(widths) != len(lengths):
            raise ValueError(
                f"widths must be as many as lengths, {len(lengths)}, got {len(widths)}."
            )
        whole = np.append(widths, width)
        if whole.min() < 1 or whole.max() > LARGEST_WIDTH:
            raise ValueError(f"widths must be between 1 and {LARGEST_WIDTH}, got {whole.max()}.")
        if (lengths > widths).any() or (lengths < np.minimum(widths, PERIOD)).any():
            raise ValueError(f"lengths must be between {PERIOD} and the rows' widths.")
        if lengths.sum() != len(values):
            raise ValueError(
                f"values must hold the {lengths.sum()} numbers that lengths add up to, got "
                f"{len(values)}."
            )
        return cls(as_finite_array(values, "values", (None,)), lengths, widths, int(width))

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that a file of the rows holds."""
        return {name: np.asarray(getattr(self, name)) for name in ARRAYS}

    @classmethod
    def concatenate(cls, parts: Sequence[TrimmedRows]) -> TrimmedRows:
        """Join rows end to end."""
        values, lengths, widths = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("values", "lengths", "widths")
        )
        return cls(values, lengths, widths, max(part.width for part in parts))

    def unpack(self, index: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return whole rows, shape (len(index), width of the widest of them).

        Narrower rows are filled up as they end: their last three numbers repeat.
        """
        width = self.widths[index].max() if len(index) else self.width
        column, length = np.arange(width), self.lengths[index][:, None]
        repeated = length - PERIOD + (column - length) % PERIOD
        offsets = np.where(column < length, column, repeated)
        return self.values[self._starts()[index][:, None] + offsets]

    def take(self, index: NDArray[np.int64]) -> TrimmedRows:
        """Return packed rows."""
        lengths = self.lengths[index]
        first = np.cumsum(lengths) - lengths
        source = np.repeat(self._starts()[index] - first, lengths) + np.arange(lengths.sum())
        return TrimmedRows(self.values[source], lengths, self.widths[index], self.width)

    def _starts(self) -> NDArray[np.int64]:
        starts: NDArray[np.int64] = np.cumsum(self.lengths) - self.lengths
        return starts


def _check_kind(array: NDArray[Any], name: str, dtype: Any, n_dims: int) -> None:
    if array.dtype != dtype or array.ndim != n_dims:
        raise ValueError(
            f"{name} must be an array of {np.dtype(dtype)} with {n_dims} dimensions, got "
            f"{array.dtype} with {array.ndim}."
        )


def as_bits(rows: NDArray[np.float64]) -> NDArray[np.int64]:
    """View numbers as their bits, which tell 0 from -0."""
    return np.ascontiguousarray(rows, dtype=np.float64).view(np.int64)
