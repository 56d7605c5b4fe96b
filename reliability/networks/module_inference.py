"""Logits of a trained torch module."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from reliability.networks.devices import is_available, one_thread


class ModuleInference:
    """Evaluates a torch module, which is rebuilt from its weights when it is first asked.

    Only the weights are pickled, as arrays, so that a file can be read without the device on which
    the module was trained.

    Parameters
    ----------
    build : callable
        Returns the module, with any weights.
    weights : dict of ndarray
        The trained module's parameters and buffers by name.
    rows_per_forward : int
        Rows that one forward pass takes at most.
    """

    prefers_batches = True
    factor = 1.0

    def __init__(
        self, build: Callable[[], Any], weights: dict[str, NDArray[Any]], rows_per_forward: int
    ) -> None:
        self.build = build
        self.weights = weights
        self.rows_per_forward = rows_per_forward
        self._modules: dict[str, nn.Module] = {}

    def logits(self, rows: NDArray[Any], device: str) -> NDArray[np.float32]:
        """Evaluate rows in large batches.

        Parameters
        ----------
        rows : ndarray of shape (n, n_features)
            float32, or uint8 if the module takes packed grids.
        device : str
            Torch device; the CPU takes its place if there is no such device here.

        Returns
        -------
        logits : ndarray of float32 of shape (n,)
        """
        if device not in self._modules:
            self._modules[device] = self._trained_module(device)
        module, n = self._modules[device], self.rows_per_forward
        place = next(module.parameters()).device
        with one_thread(), torch.inference_mode():
            batches = [rows[first : first + n] for first in range(0, len(rows), n)]
            parts = [module(_as_tensor(batch).to(place)).reshape(-1).cpu() for batch in batches]
            return torch.cat(parts).numpy() * np.float32(self.factor)

    fast_logits = logits

    def check(self, n_features: int) -> None:
        """Raise ``ValueError`` unless all weights are finite; torch itself checks their shapes."""
        if not all(np.isfinite(weight).all() for weight in self.weights.values()):
            raise ValueError("a weight is not finite")

    def soften(self, factor: float) -> None:
        """Multiply all logits by a positive factor from now on."""
        self.factor *= factor

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the modules, which are rebuilt from the weights."""
        return self.__dict__ | {"_modules": {}}

    def _trained_module(self, device: str) -> nn.Module:
        module: Any = self.build()
        module.load_state_dict(as_tensors(self.weights))
        module.eval().to(device if is_available(device) else "cpu")
        if hasattr(module, "for_inference"):
            module.for_inference()
        return module


def as_tensors(weights: dict[str, NDArray[Any]]) -> dict[str, Tensor]:
    """Return arrays as tensors that share their memory."""
    return {name: torch.from_numpy(array) for name, array in weights.items()}


def _as_tensor(rows: NDArray[Any]) -> Tensor:
    # Torch refuses views that run backwards, and warns of arrays that can't be written.
    return torch.from_numpy(np.require(rows, requirements=["C", "W"]))
