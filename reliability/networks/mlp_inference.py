"""Logits of a trained multilayer perceptron, by a compiled forward pass.

Planners classify a handful of transitions per call, for which calling a tensor library takes many
times as long as the arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.compilation import compiled
from systems.extras import needing

# From so many rows on, the tensor library is faster in spite of its import.
ROWS_FOR_TORCH = 2048
LEAKY_SLOPE = np.float32(0.01)
# A generous bound on what rounding does to a logit, per unit of the largest term in the first sums.
LOGIT_ROUNDING = np.float32(1e-4)
# Rows that are multiplied with each part of the weights while it is in the fastest cache.
ROWS_PER_BLOCK = 8
_REBUILT = ("_in_torch", "_flat", "_largest_weights")


class MLPInference:
    """Evaluates a multilayer perceptron: small batches compiled, large ones with torch.

    Parameters
    ----------
    build : callable
        Returns the torch module, with any weights.
    weights : dict of ndarray
        The trained module's weights and biases, layer by layer.
    rows_per_forward : int
        Rows that one forward pass of torch takes at most.
    """

    prefers_batches = False

    def __init__(
        self,
        build: Callable[[], Any],
        weights: dict[str, NDArray[np.float32]],
        rows_per_forward: int,
    ) -> None:
        self.build = build
        self.weights = weights
        self.rows_per_forward = rows_per_forward

    def logits(self, rows: NDArray[Any], device: str) -> NDArray[np.float32]:
        """Return logits whose signs are those of :meth:`fast_logits`.

        Parameters
        ----------
        rows : ndarray of float32 of shape (n, n_features)
        device : str
            Torch device for large batches.

        Returns
        -------
        logits : ndarray of float32 of shape (n,)
        """
        if len(rows) < ROWS_FOR_TORCH:
            return self.fast_logits(rows, device)
        logits = self._in_torch.logits(rows, device)
        # Near zero the two ways may round to different signs, so the compiled one decides.
        largest = 1 + np.abs(rows * self._largest_weights).max(axis=1)
        uncertain = np.abs(logits) < LOGIT_ROUNDING * largest
        logits[uncertain] = self.fast_logits(rows[uncertain], device)
        return logits

    def fast_logits(self, rows: NDArray[Any], device: str) -> NDArray[np.float32]:
        """Return logits by the compiled forward pass; of a row, the same in every batch."""
        rows = np.array(rows, dtype=np.float32, order="C")
        return mlp_logits(rows, *self._flat, LEAKY_SLOPE)

    def check(self, n_features: int) -> None:
        """Raise ``ValueError`` unless the weights fit together, as the compiled pass relies on."""
        arrays = list(self.weights.values())
        width = n_features
        for weight, bias in zip(arrays[0::2], arrays[1::2], strict=True):
            fits = weight.dtype == bias.dtype == np.float32 and weight.shape == (len(bias), width)
            if not fits or bias.ndim != 1:
                raise ValueError("the weights of a layer do not fit those before")
            width = len(bias)
        if not arrays or width != 1 or not all(np.isfinite(array).all() for array in arrays):
            raise ValueError("the weights do not lead to one finite logit")

    def soften(self, factor: float) -> None:
        """Multiply all logits by a positive factor from now on."""
        *_, weight, bias = self.weights.values()
        weight *= np.float32(factor)
        bias *= np.float32(factor)
        for rebuilt in _REBUILT:
            self.__dict__.pop(rebuilt, None)

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what is rebuilt from the weights."""
        return {name: value for name, value in self.__dict__.items() if name not in _REBUILT}

    @cached_property
    def _in_torch(self) -> Any:
        # Importing torch takes seconds, which small batches need not pay.
        with needing("torch", "This network"):
            from reliability.networks.module_inference import ModuleInference

        return ModuleInference(self.build, self.weights, self.rows_per_forward)

    @cached_property
    def _largest_weights(self) -> NDArray[np.float32]:
        """The largest weight of each feature, at least 1: of tiny features they are large."""
        first = next(iter(self.weights.values()))
        return np.maximum(np.abs(first).max(axis=0), 1)

    @cached_property
    def _flat(self) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        arrays = list(self.weights.values())
        weights, biases = arrays[0::2], arrays[1::2]
        sizes = np.array([weights[0].shape[1], *(len(bias) for bias in biases)])
        layers = zip(weights, biases, strict=True)
        return sizes, np.concatenate([part.ravel() for w, b in layers for part in (w.T, b)])


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
