"""How far probabilities are from the shares of what they foretell."""

from __future__ import annotations

import numpy as np

N_BINS = 10


def calibration_error(probability: np.ndarray, happened: np.ndarray) -> float:
    """Return the expected calibration error, with ten bins of equal width.

    In each bin the mean probability is compared with the share that happened; the gaps are
    averaged, weighted by the numbers in the bins.
    """
    gaps = np.bincount(bin_of(probability), happened - probability, minlength=N_BINS)
    return float(np.abs(gaps).sum() / len(happened))


def bin_of(probability: np.ndarray) -> np.ndarray:
    """Return the number of the bin that each probability falls into."""
    return np.minimum((N_BINS * probability).astype(int), N_BINS - 1)
