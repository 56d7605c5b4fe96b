"""Training of a network, which skorch carries out."""

from __future__ import annotations

import os
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from skorch import NeuralNet
from skorch.callbacks import Callback, EarlyStopping, LRScheduler
from skorch.helper import predefined_split

from reliability.fit_callbacks import FitTasks
from reliability.networks.batches import Batches, LabelledRows, digest
from reliability.networks.checkpoint import Checkpoint
from reliability.networks.devices import check_device, one_thread
from reliability.networks.epoch_callback import EpochCallback
from reliability.networks.hyperparameters import Hyperparameters, as_plain
from reliability.networks.metrics import CALIBRATED_LOSS, EpochMetrics, WeightedLoss
from reliability.networks.progress import FinishedEpochs, ProgressBar

# A training and its continuation may differ in this.
_FREE = {"max_epochs"}
_RECORDED = ("epoch", "train_loss", "valid_loss", CALIBRATED_LOSS, "valid_accuracy")


class TrainingTask(NamedTuple):
    """What to train, on what, and how."""

    backend: Any
    training: LabelledRows
    held_out: LabelledRows
    hyperparameters: Hyperparameters
    seed: int
    device: str
    checkpoint: str | os.PathLike[str] | None
    verbose: int
    weights: dict[str, NDArray[Any]] | None = None  # to start from; None for random ones
    fit_tasks: FitTasks | None = None  # tells scikit-learn's callbacks, if there are any


def train(task: TrainingTask) -> tuple[dict[str, NDArray[Any]], list[dict[str, float]]]:
    """Train a network on weighted rows.

    Torch's global random generators are left as they were.

    Returns
    -------
    weights : dict of ndarray
        The module's parameters and buffers by name.
    history : list of dict
        Per epoch: epoch, train_loss and, with held-out rows, valid_loss and valid_accuracy.

    Raises
    ------
    ValueError
        If there is no such device, or the checkpoint can't be written.
    FloatingPointError
        If the loss stops being finite.
    ModelFileError
        If the checkpoint is damaged, or of another training.
    KeyboardInterrupt
        If the user interrupts.
    """
    check_device(task.device)
    cuda_devices = [task.device] if task.device.startswith("cuda") else []
    stop, epochs, finished = _early_stopping(task), _epoch_callback(task), FinishedEpochs()
    with one_thread(), torch.random.fork_rng(cuda_devices):
        torch.manual_seed(task.seed)
        callbacks = [*_callbacks(task, stop, epochs), ("finished", finished)]
        net = _network(task, callbacks)
        net.fit(task.training)
    # skorch ends the training quietly when the user interrupts it.
    told_to_stop = _has_stopped(stop) or (epochs is not None and epochs.stopped)
    if finished.n_epochs < task.hyperparameters.max_epochs and not told_to_stop:
        raise KeyboardInterrupt
    history = net.history.to_list()
    weights = task.backend.weights(net.module_)
    rows = [{name: as_plain(row[name]) for name in _RECORDED if name in row} for row in history]
    return weights, rows


def _network(task: TrainingTask, callbacks: list[tuple[str, Callback]]) -> NeuralNet:
    chosen = task.hyperparameters
    return NeuralNet(
        partial(task.backend.module_for, task.training, task.weights),
        criterion=WeightedLoss,
        optimizer=torch.optim.Adam,
        optimizer__fused=True,
        lr=chosen.learning_rate,
        max_epochs=chosen.max_epochs,
        batch_size=chosen.batch_size,
        iterator_train=Batches,
        iterator_train__shuffle=True,
        iterator_train__balanced=chosen.balanced_batches,
        iterator_train__n_rows=_rows_per_epoch(task),
        iterator_valid=Batches,
        iterator_valid__batch_size=task.backend.rows_per_forward,
        train_split=predefined_split(task.held_out) if len(task.held_out) else None,
        callbacks=callbacks,
        callbacks__print_log=None,
        device=task.device,
        verbose=0,
    )


def _callbacks(
    task: TrainingTask, stop: EarlyStopping | None, epochs: EpochCallback | None
) -> list[tuple[str, Callback]]:
    chosen = task.hyperparameters
    decay = LRScheduler(
        torch.optim.lr_scheduler.StepLR,
        step_size=chosen.epochs_per_decay,
        gamma=chosen.learning_rate_decay,
    )
    callbacks: list[tuple[str, Callback]] = [("metrics", EpochMetrics()), ("decay", decay)]
    if task.verbose:
        n_batches = -(-_rows_per_epoch(task) // chosen.batch_size)
        callbacks.insert(0, ("progress", ProgressBar(chosen.max_epochs, n_batches)))
    if epochs is not None:
        callbacks.append(("epochs", epochs))
    if stop is not None:
        callbacks.append(("stop", stop))
    if task.checkpoint is not None:
        # After the others, as it keeps their state.
        checkpoint = Checkpoint(task.checkpoint, _identity(task), decay, stop)
        callbacks.append(("checkpoint", checkpoint))
    return callbacks


def _early_stopping(task: TrainingTask) -> EarlyStopping | None:
    patience = task.hyperparameters.patience
    if patience is False or not len(task.held_out):
        return None
    return EarlyStopping(
        CALIBRATED_LOSS, patience=patience, threshold=0.0, load_best=True, sink=_no_output
    )


def _epoch_callback(task: TrainingTask) -> EpochCallback | None:
    if task.fit_tasks is None or not task.fit_tasks.any:
        return None
    rows = task.training.rows
    return EpochCallback(task.fit_tasks, task.backend, rows.shape[1], rows.dtype == np.uint8)


def _has_stopped(stop: EarlyStopping | None) -> bool:
    return stop is not None and stop.misses_ >= stop.patience


def _rows_per_epoch(task: TrainingTask) -> int:
    chosen = task.hyperparameters
    fewest = task.backend.fewest_batches * chosen.batch_size
    return chosen.rows_per_epoch or max(len(task.training), fewest)


def _identity(task: TrainingTask) -> dict[str, str]:
    """Return what the outcome of a training depends on, in words that a user can compare."""
    backend = task.backend.get_params(deep=False)
    chosen = {k: v for k, v in vars(task.hyperparameters).items() if k not in _FREE}
    values = {"backend": type(task.backend).__name__, **backend, **chosen}
    values |= {"device": task.device, "seed drawn from random_state": task.seed}
    values |= {"torch": str(torch.__version__)}
    selected = {
        "digest of the training rows": task.training.index,
        "digest of the held-out rows": task.held_out.index,
    }
    start = {f"digest of {name} at the start": w for name, w in (task.weights or {}).items()}
    return (
        {name: repr(as_plain(value)) for name, value in values.items()}
        | task.training.digests()
        | {name: digest(array) for name, array in {**selected, **start}.items()}
    )


def _no_output(*text: object) -> None:
    pass
