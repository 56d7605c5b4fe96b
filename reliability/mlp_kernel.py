"""Compiled forward pass of a small multilayer perceptron.

Planners classify a handful of transitions per call, where the overhead of a tensor library
is many times the arithmetic.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.compilation import compiled

# A block of rows shares each slice of the weights while it is in the fastest cache.
ROWS_PER_BLOCK = 8


@compiled(fastmath={"contract", "reassoc", "nsz"})
def mlp_logits(
    rows: NDArray[np.float32],
    sizes: NDArray[np.int64],
    parameters: NDArray[np.float32],
    negative_slope: np.float32,
) -> NDArray[np.float32]:
    """Logits of a LeakyReLU network with one output.

    The sums of a row are taken in the same order whatever the other rows are, so that a row's
    logit does not depend on its batch.

    Parameters
    ----------
    rows : ndarray of float32 of shape (n, n_features)
    sizes : ndarray of int of shape (n_layers + 1,)
        n_features, the units of each hidden layer, and 1.
    parameters : ndarray of float32
        Layer by layer, the weights, (n_inputs, n_outputs) in C order, and the biases.
    negative_slope : float32

    Returns
    -------
    logits : ndarray of float32 of shape (n,)
    """
    widest = sizes.max()
    source = np.empty((ROWS_PER_BLOCK, widest), np.float32)
    target = np.empty((ROWS_PER_BLOCK, widest), np.float32)
    logits = np.empty(rows.shape[0], np.float32)
    for first in range(0, rows.shape[0], ROWS_PER_BLOCK):
        n_rows = min(ROWS_PER_BLOCK, rows.shape[0] - first)
        for row in range(n_rows):
            for i in range(sizes[0]):
                source[row, i] = rows[first + row, i]
        offset = 0
        for layer in range(sizes.size - 1):
            n_inputs, n_outputs = sizes[layer], sizes[layer + 1]
            biases = offset + n_inputs * n_outputs
            for row in range(n_rows):
                for j in range(n_outputs):
                    target[row, j] = parameters[biases + j]
            unrolled = n_inputs - n_inputs % 4
            for i in range(0, unrolled, 4):
                slab = parameters[offset + i * n_outputs : offset + (i + 4) * n_outputs]
                weights_0 = slab[:n_outputs]
                weights_1 = slab[n_outputs : 2 * n_outputs]
                weights_2 = slab[2 * n_outputs : 3 * n_outputs]
                weights_3 = slab[3 * n_outputs :]
                for row in range(n_rows):
                    input_0, input_1 = source[row, i], source[row, i + 1]
                    input_2, input_3 = source[row, i + 2], source[row, i + 3]
                    for j in range(n_outputs):
                        target[row, j] += (
                            input_0 * weights_0[j]
                            + input_1 * weights_1[j]
                            + input_2 * weights_2[j]
                            + input_3 * weights_3[j]
                        )
            for i in range(unrolled, n_inputs):
                for row in range(n_rows):
                    for j in range(n_outputs):
                        target[row, j] += source[row, i] * parameters[offset + i * n_outputs + j]
            if layer < sizes.size - 2:
                for row in range(n_rows):
                    for j in range(n_outputs):
                        value = target[row, j]
                        target[row, j] = value if value > 0 else negative_slope * value
            source, target = target, source
            offset = biases + n_outputs
        for row in range(n_rows):
            logits[first + row] = source[row, 0]
    return logits
