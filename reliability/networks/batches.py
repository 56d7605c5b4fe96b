"""Labelled rows, and the batches of them that a network is trained on."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset

from reliability.training_set import thin

# Columns of the labels of a batch.
TARGET, LOSS_WEIGHT, SAMPLE_WEIGHT = range(3)
_BYTES_AT_ONCE = 2**26
_MOST_SCALED = 2**16
# How far apart the quartiles of a normal distribution are, in standard deviations.
_NORMAL_QUARTILES = 1.349


@dataclass(frozen=True, eq=False)
class LabelledRows(Dataset[Any]):
    """Rows to train or to validate on: a selection among all rows, of which none is copied.

    Attributes
    ----------
    rows : ndarray of shape (n_all, n_features)
    target : ndarray of shape (n_all,)
        1 for the second class, 0 for the first.
    loss_weight : ndarray of shape (n_all,)
        In the loss: the product of the weights of the row and of its class.
    sample_weight : ndarray of shape (n_all,)
        In the accuracy: the weight of the row.
    index : ndarray of int of shape (n,)
        The selected rows.
    """

    rows: NDArray[Any]
    target: NDArray[np.intp]
    loss_weight: NDArray[np.float64]
    sample_weight: NDArray[np.float64]
    index: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.index)

    def select(self, index: NDArray[np.intp]) -> LabelledRows:
        """Return another selection among the same rows."""
        return replace(self, index=index)

    def weighted(self) -> LabelledRows:
        """Return the selected rows that have a weight in the loss."""
        return self.select(self.index[self.loss_weight[self.index] > 0])

    def batch(self, places: NDArray[np.intp]) -> tuple[Tensor, Tensor]:
        """Return rows and their labels.

        Parameters
        ----------
        places : ndarray of int of shape (n,)
            Places in ``index``.

        Returns
        -------
        rows : Tensor of shape (n, n_features)
        labels : Tensor of float32 of shape (n, 3)
            With the columns TARGET, LOSS_WEIGHT and SAMPLE_WEIGHT.
        """
        index = self.index[places]
        columns = (self.target[index], self.loss_weight[index], self.sample_weight[index])
        labels = np.column_stack(columns).astype(np.float32)
        return torch.from_numpy(self.rows[index]), torch.from_numpy(labels)

    def middle_and_scale(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return each feature's median and spread, of at most 65,536 of the rows.

        The spread is that of the middle half, as a normal distribution's standard deviation, since
        a few wild values must not make all others look alike; but at least a tenth of the standard
        deviation, so that wild values stay within reason. It is 1 for a constant feature.

        Returns
        -------
        middle, scale : ndarray of shape (n_features,)
        """
        rows = self.rows[thin(self.index, _MOST_SCALED)].astype(np.float64)
        low, middle, high = np.percentile(rows, [25, 50, 75], axis=0)
        deviation = rows.std(axis=0)
        spread = np.maximum((high - low) / _NORMAL_QUARTILES, deviation / 10)
        scale = np.where(high > low, spread, deviation)
        return middle, np.where(rows.min(axis=0) < rows.max(axis=0), scale, 1.0)

    def digests(self) -> dict[str, str]:
        """Return a digest of each of the arrays, to tell whether two trainings have the same."""
        return {
            "digest of X": digest(self.rows),
            "digest of y": digest(self.target),
            "digest of the weights": digest(self.loss_weight) + digest(self.sample_weight),
        }


class Batches:
    """Iterates over batches of labelled rows, each sliced at once instead of row by row.

    Parameters
    ----------
    dataset : LabelledRows
    batch_size : int
    n_rows : int, default=None
        Rows in all. None takes each row once.
    shuffle : bool, default=False
        In random order, in which no row comes again before all have come.
    balanced : bool, default=False
        At random, with replacement, so that both classes are equally likely.
    """

    def __init__(
        self,
        dataset: LabelledRows,
        batch_size: int,
        n_rows: int | None = None,
        shuffle: bool = False,
        balanced: bool = False,
    ) -> None:
        self._dataset = dataset
        self._batch_size = batch_size
        self._n_rows = n_rows or len(dataset)
        self._shuffle = shuffle
        self._balanced = balanced

    def __len__(self) -> int:
        return -(-self._n_rows // self._batch_size)

    def __iter__(self) -> Iterator[tuple[Tensor, Tensor]]:
        for places in self._order().split(self._batch_size):
            yield self._dataset.batch(places.numpy())

    def _order(self) -> Tensor:
        n_rows = len(self._dataset)
        if self._balanced:
            return self._balanced_draws()
        if not self._shuffle:
            return torch.arange(n_rows)
        rounds = -(-self._n_rows // n_rows)
        return torch.cat([torch.randperm(n_rows) for _ in range(rounds)])[: self._n_rows]

    def _balanced_draws(self) -> Tensor:
        data = self._dataset
        target = torch.from_numpy(data.target[data.index].astype(np.float32))
        share = target.mean()
        probability = torch.where(target > 0.5, 1 - share, share)
        return torch.multinomial(probability, self._n_rows, replacement=True)


def digest(array: NDArray[Any]) -> str:
    """Return a digest of an array, read piece by piece, as it may be a file larger than memory."""
    total = hashlib.blake2b(f"{array.dtype.str} {array.shape}".encode(), digest_size=8)
    n_rows = max(1, _BYTES_AT_ONCE // max(1, array[:1].nbytes))
    for first in range(0, len(array), n_rows):
        total.update(np.ascontiguousarray(array[first : first + n_rows]).data)
    return total.hexdigest()
