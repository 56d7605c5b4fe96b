"""Compiled forward pass of a small multilayer perceptron, one row at a time.

Planners classify a handful of transitions per call, where the overhead of a tensor library
is many times the arithmetic.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, fastmath={"contract", "reassoc", "nsz"}, nogil=True)
def mlp_logits(
    rows: NDArray[np.float32],
    weights: tuple[NDArray[np.float32], ...],
    biases: tuple[NDArray[np.float32], ...],
    negative_slope: np.float32,
) -> NDArray[np.float32]:
    """Logits of a LeakyReLU network with one output.

    Each row is computed by itself, so that its logit does not depend on the batch.

    Parameters
    ----------
    rows : ndarray of float32 of shape (n, n_features)
    weights : tuple of ndarray of float32 of shape (n_inputs, n_outputs)
    biases : tuple of ndarray of float32 of shape (n_outputs,)
    negative_slope : float32

    Returns
    -------
    logits : ndarray of float32 of shape (n,)
    """
    widest = 0
    for bias in biases:
        widest = max(widest, bias.size)
    source = np.empty(max(widest, rows.shape[1]), np.float32)
    target = np.empty(max(widest, rows.shape[1]), np.float32)
    logits = np.empty(rows.shape[0], np.float32)
    last = len(weights) - 1
    for row in range(rows.shape[0]):
        for i in range(rows.shape[1]):
            source[i] = rows[row, i]
        for layer in range(last):
            weight = weights[layer]
            bias = biases[layer]
            n_inputs, n_outputs = weight.shape
            for j in range(n_outputs):
                target[j] = bias[j]
            unrolled = n_inputs - n_inputs % 4
            for i in range(0, unrolled, 4):
                first, second = source[i], source[i + 1]
                third, fourth = source[i + 2], source[i + 3]
                for j in range(n_outputs):
                    target[j] += (
                        first * weight[i, j]
                        + second * weight[i + 1, j]
                        + third * weight[i + 2, j]
                        + fourth * weight[i + 3, j]
                    )
            for i in range(unrolled, n_inputs):
                value = source[i]
                for j in range(n_outputs):
                    target[j] += value * weight[i, j]
            for j in range(n_outputs):
                value = target[j]
                target[j] = value if value > 0 else negative_slope * value
            source, target = target, source
        logit = biases[last][0]
        for i in range(weights[last].shape[0]):
            logit += source[i] * weights[last][i, 0]
        logits[row] = logit
    return logits
