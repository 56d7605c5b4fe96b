"""How often transitions of a predicted probability turn out Reliable."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sklearn.calibration import calibration_curve

N_BINS = 10


class CalibrationCurve(NamedTuple):
    """Predicted probabilities in ten bins of equal width, without those that are empty.

    Attributes
    ----------
    predicted : ndarray of shape (n_bins,)
        Mean probability in each bin.
    observed : ndarray of shape (n_bins,)
        Share of its transitions that are Reliable.
    n_transitions : ndarray of int of shape (n_bins,)
    """

    predicted: NDArray[np.float64]
    observed: NDArray[np.float64]
    n_transitions: NDArray[np.int64]

    @classmethod
    def of(cls, reliable: NDArray[np.bool_], probability: NDArray[np.float64]) -> CalibrationCurve:
        """Compute the curve of n transitions; of none, it has no bins."""
        if not len(reliable):
            return cls(np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.int64))
        observed, predicted = calibration_curve(reliable, probability, n_bins=N_BINS)
        # calibration_curve does not tell how many fell into its bins.
        bins = np.searchsorted(np.linspace(0, 1, N_BINS + 1)[1:-1], probability)
        counts = np.bincount(bins, minlength=N_BINS)
        return cls(predicted, observed, counts[counts > 0])

    @property
    def expected_error(self) -> float:
        """Mean of the bins' gaps between predicted and observed, by size; NaN without any."""
        if not len(self.n_transitions):
            return float("nan")
        gaps = np.abs(self.predicted - self.observed)
        return float(np.average(gaps, weights=self.n_transitions))
