"""Rows that end in repeats, kept without them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Coordinates of a point: a band that is shorter than its row repeats its last point.
PERIOD = 3
# Far above any reduced state; a file that claims more would fill the memory when it is unpacked.
LARGEST_WIDTH = 100_000


@dataclass(frozen=True, eq=False)
class TrimmedRows:
    """Rows of numbers of which each is stored up to where its last three begin to repeat.

    Nothing is lost: the rows come back bit by bit.

    Attributes
    ----------
    values : ndarray of shape (n_values,)
        The rows one after another.
    lengths : ndarray of int of shape (n_rows,)
        How many numbers of each row are stored.
    width : int
        Length of a whole row.
    """

    values: NDArray[np.float64]
    lengths: NDArray[np.int64]
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
        lengths = width - np.argmax(differs[:, ::-1], axis=1)
        kept = np.arange(width) < lengths[:, None]
        return cls(np.asarray(rows, dtype=np.float64)[kept], lengths, width)

    def check(self) -> None:
        """Raise ``ValueError`` unless the three belong together."""
        if self.values.dtype != np.float64 or self.values.ndim != 1:
            raise ValueError(f"values must be one row of float64, got {self.values.dtype}.")
        if not np.isfinite(self.values).all():
            raise ValueError("values must be finite, got NaN or infinity.")
        if self.lengths.dtype != np.int64 or self.lengths.ndim != 1:
            raise ValueError(f"lengths must be one row of int64, got {self.lengths.dtype}.")
        least = min(self.width, PERIOD)
        if not 0 < self.width <= LARGEST_WIDTH:
            raise ValueError(f"width must be between 1 and {LARGEST_WIDTH}, got {self.width}.")
        if len(self.lengths) and not least <= self.lengths.min() <= self.lengths.max() <= self.width:
            raise ValueError(f"lengths must be between {least} and the width, {self.width}.")
        if self.lengths.sum() != len(self.values):
            raise ValueError(
                f"values must hold the {self.lengths.sum()} numbers that lengths add up to, got "
                f"{len(self.values)}."
            )

    @classmethod
    def concatenate(cls, parts: Sequence[TrimmedRows]) -> TrimmedRows:
        """Join rows end to end; all must be of one width."""
        widths = sorted({part.width for part in parts})
        if len(widths) != 1:
            raise ValueError(f"parts must have rows of one length, got {widths}.")
        values = np.concatenate([part.values for part in parts])
        return cls(values, np.concatenate([part.lengths for part in parts]), widths[0])

    def unpack(self, index: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return whole rows, shape (len(index), width)."""
        column, length = np.arange(self.width), self.lengths[index][:, None]
        repeated = length - PERIOD + (column - length) % PERIOD
        offsets = np.where(column < length, column, repeated)
        return self.values[self._starts()[index][:, None] + offsets]

    def take(self, index: NDArray[np.int64]) -> TrimmedRows:
        """Return packed rows."""
        lengths = self.lengths[index]
        first = np.cumsum(lengths) - lengths
        source = np.repeat(self._starts()[index] - first, lengths) + np.arange(lengths.sum())
        return TrimmedRows(self.values[source], lengths, self.width)

    def _starts(self) -> NDArray[np.int64]:
        starts: NDArray[np.int64] = np.cumsum(self.lengths) - self.lengths
        return starts


def as_bits(rows: NDArray[np.float64]) -> NDArray[np.int64]:
    """View numbers as their bits, which tell 0 from -0."""
    return np.ascontiguousarray(rows, dtype=np.float64).view(np.int64)
