"""The answer of a classifier that saw rows of one class only."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# Of a probability that differs from 1 by rounding alone.
CERTAIN_LOGIT = 30.0


class ConstantInference:
    """The same logit for every row.

    Parameters
    ----------
    positive : bool
        Whether the second class is the one.
    """

    prefers_batches = False

    def __init__(self, positive: bool) -> None:
        self.logit = CERTAIN_LOGIT if positive else -CERTAIN_LOGIT

    def logits(self, rows: NDArray[Any], device: str) -> NDArray[np.float32]:
        """Return the logit once for each row, shape (n,)."""
        return np.full(len(rows), self.logit, dtype=np.float32)

    fast_logits = logits

    def check(self, n_features: int) -> None:
        """Raise ``ValueError`` unless the logit is finite."""
        if not np.isfinite(self.logit):
            raise ValueError("the logit is not finite")

    def soften(self, factor: float) -> None:
        """Leave the logit as it is: there was nothing else to learn."""
