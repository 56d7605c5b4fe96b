"""Scikit-learn's callbacks in a training that skorch carries out."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import torch
from skorch import NeuralNet
from skorch.callbacks import Callback

from reliability.fit_callbacks import FitTasks


class EpochCallback(Callback):
    """Tells scikit-learn's callbacks of each epoch, and stops the training if they ask for it.

    Parameters
    ----------
    tasks : FitTasks
    backend : Backend
    n_features : int
    packed : bool
        Whether rows are bit-packed voxel grids.

    Attributes
    ----------
    stopped : bool
        Whether a callback has stopped the training.
    """

    def __init__(self, tasks: FitTasks, backend: Any, n_features: int, packed: bool) -> None:
        self.tasks = tasks
        self.backend = backend
        self.n_features = n_features
        self.packed = packed
        self.stopped = False

    def on_epoch_begin(self, net: NeuralNet, **kwargs: Any) -> None:
        """Tell that an epoch begins."""
        self.tasks.begin_epoch()

    def on_epoch_end(self, net: NeuralNet, **kwargs: Any) -> None:
        """Tell that an epoch is done."""

        def inference() -> Any:
            # Reading out the weights changes the module.
            weights = self.backend.weights(deepcopy(net.module_))
            return self.backend.inference(self.n_features, self.packed, weights)

        # Rebuilding a module draws random weights, which must not disturb the training.
        with torch.random.fork_rng([]):
            self.stopped = self.tasks.end_epoch(inference)
        if self.stopped:
            raise KeyboardInterrupt  # which is how skorch is told to end a training
