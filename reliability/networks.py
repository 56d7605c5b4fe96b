"""The classifier's multilayer perceptron, and the training of any network through skorch."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from skorch import NeuralNet
from skorch.callbacks import Callback, EarlyStopping, LRScheduler
from skorch.helper import predefined_split
from torch import Tensor, nn
from torch.utils.data import Dataset
from tqdm.auto import tqdm

from reliability.checkpoint import Checkpoint, digest

ROWS_PER_FORWARD = 8192
State = dict[str, NDArray[np.float32]]


class MLP(nn.Module):
    """The paper's network: LeakyReLU layers and one logit.

    Parameters
    ----------
    n_features : int
    hidden_layer_sizes : tuple of int
    """

    def __init__(self, n_features: int, hidden_layer_sizes: tuple[int, ...]) -> None:
        super().__init__()
        sizes = [n_features, *hidden_layer_sizes]
        layers: list[nn.Module] = []
        for n_inputs, n_outputs in itertools.pairwise(sizes):
            layers += [nn.Linear(n_inputs, n_outputs), nn.LeakyReLU()]
        self.layers = nn.Sequential(*layers, nn.Linear(sizes[-1], 1))

    def forward(self, rows: Tensor) -> Tensor:
        """Map (n, n_features) rows to (n, 1) logits."""
        return self.layers(rows)


@dataclass(frozen=True, eq=False)
class TrainingData(Dataset[Any]):
    """Rows to learn from or to validate on; which they are among all, so that none is copied.

    Attributes
    ----------
    rows : ndarray of shape (n_all, n_features)
    target : ndarray of shape (n_all,)
        1 for the second class, 0 for the first.
    weight : ndarray of shape (n_all,)
    index : ndarray of int of shape (n,)
    """

    rows: NDArray[Any]
    target: NDArray[np.intp]
    weight: NDArray[np.float64]
    index: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.index)

    def batch(self, places: NDArray[np.intp]) -> tuple[Tensor, Tensor]:
        """Return rows, and pairs of target and weight, at places in the index."""
        index = self.index[places]
        pairs = np.column_stack([self.target[index], self.weight[index]]).astype(np.float32)
        return torch.from_numpy(self.rows[index]), torch.from_numpy(pairs)


@dataclass(frozen=True)
class TrainingPlan:
    """How to train; the fields are the classifier's parameters of the same names.

    ``provenance`` tells the checkpoint what else the training depends on.
    """

    max_epochs: int
    batch_size: int
    rows_per_epoch: int | None
    learning_rate: float
    learning_rate_decay: float
    epochs_per_decay: int
    patience: int | None
    balanced_batches: bool
    device: str
    verbose: int
    checkpoint: str | os.PathLike[str] | None
    provenance: dict[str, Any]


PLAN_PARAMETERS = tuple(field.name for field in fields(TrainingPlan) if field.name != "provenance")
# What may differ between a training and its continuation.
_FREE_PARAMETERS = {"max_epochs", "checkpoint", "verbose", "random_state"}


def provenance(
    parameters: dict[str, Any],
    data: tuple[NDArray[Any], ...],
    training: NDArray[np.intp],
    held_out: NDArray[np.intp],
    seed: int,
) -> dict[str, Any]:
    """Return what the outcome of a training depends on, as strings."""
    told = {name: repr(v) for name, v in parameters.items() if name not in _FREE_PARAMETERS}
    rows = digest([*data, training, held_out])
    return told | {"random_state": str(seed), "data": rows, "torch": str(torch.__version__)}


class _Batches:
    """Slices of a dataset, in place of a loader that collates row by row."""

    def __init__(
        self,
        dataset: TrainingData,
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
            data = self._dataset
            target = torch.from_numpy(data.target[data.index].astype(np.float32))
            share = target.mean()
            weight = torch.where(target > 0.5, 1 - share, share)
            return torch.multinomial(weight, self._n_rows, replacement=True)
        if not self._shuffle:
            return torch.arange(n_rows)
        # Rows are drawn anew each epoch; none twice, as long as there are enough.
        rounds = -(-self._n_rows // n_rows)
        return torch.cat([torch.randperm(n_rows) for _ in range(rounds)])[: self._n_rows]


class _WeightedLoss(nn.Module):
    def forward(self, logits: Tensor, pairs: Tensor) -> Tensor:
        loss = nn.functional.binary_cross_entropy_with_logits(
            logits.reshape(-1), pairs[:, 0], reduction="none"
        )
        return (loss * pairs[:, 1]).sum() / pairs[:, 1].sum().clamp_min(1e-12)


class _Watch(Callback):
    """Counts correct answers, shows progress, stops at divergence."""

    def __init__(self, max_epochs: int, n_batches: int, verbose: int) -> None:
        self.max_epochs = max_epochs
        self.n_batches = n_batches
        self.verbose = verbose

    def on_train_begin(self, net: NeuralNet, **kwargs: Any) -> None:
        self.bar_ = tqdm(
            total=self.max_epochs * self.n_batches, unit="batch", disable=not self.verbose
        )
        self.shown_: dict[str, str] = {}

    def on_epoch_begin(self, net: NeuralNet, **kwargs: Any) -> None:
        self.epoch_, self.loss_ = len(net.history), 0.0
        self.correct_, self.rows_ = {True: 0, False: 0}, {True: 0, False: 0}
        if self.verbose:
            if self.bar_.n == 0:  # Epochs of the checkpoint took no time.
                self.bar_.n = self.bar_.initial = (self.epoch_ - 1) * self.n_batches
            self.bar_.set_description(f"epoch {self.epoch_}/{self.max_epochs}", refresh=False)

    def on_batch_end(self, net: NeuralNet, batch: Any, training: bool, **kwargs: Any) -> None:
        if training and not self.verbose:
            return
        answers = kwargs["y_pred"].reshape(-1) > 0
        truth = batch[1][:, 0].to(answers.device) > 0.5
        self.correct_[training] += int((answers == truth).sum())
        self.rows_[training] += len(truth)
        if training:
            self.loss_ += kwargs["loss"].item() * len(truth)
            self._show(True, loss=self.loss_ / self.rows_[True])

    def on_epoch_end(self, net: NeuralNet, **kwargs: Any) -> None:
        row = net.history[-1]
        loss = row["train_loss"]
        if not np.isfinite(loss):
            raise FloatingPointError(
                f"Training diverged in epoch {self.epoch_}: the loss is {loss}. "
                "Scale the features, or lower learning_rate."
            )
        row["batches"].clear()  # One entry per batch would outgrow the network.
        if self.rows_[False]:
            net.history.record("valid_accuracy", self.correct_[False] / self.rows_[False])
            if self.verbose:
                self._show(False)

    def on_train_end(self, net: NeuralNet, **kwargs: Any) -> None:
        self.bar_.close()

    def _show(self, training: bool, **numbers: float) -> None:
        name = "accuracy" if training else "held-out accuracy"
        numbers[name] = self.correct_[training] / self.rows_[training]
        self.shown_ |= {key: f"{number:.4f}" for key, number in numbers.items()}
        self.bar_.set_postfix(self.shown_, refresh=not training)
        if training:
            self.bar_.update()


class one_thread:  # noqa: N801
    """Context in which torch uses one thread, so that sums come out the same everywhere."""

    def __enter__(self) -> None:
        self._before = torch.get_num_threads()
        torch.set_num_threads(1)

    def __exit__(self, *error: object) -> None:
        torch.set_num_threads(self._before)


def train(
    module: type[nn.Module],
    module_parameters: dict[str, Any],
    training: TrainingData,
    held_out: TrainingData | None,
    plan: TrainingPlan,
    seed: int,
) -> tuple[State, list[dict[str, float]]]:
    """Train a module on weighted rows.

    Torch's global generators are left as they were.

    Returns
    -------
    state : dict of ndarray
        The module's parameters and buffers, on the CPU.
    history : list of dict
        Per epoch: train_loss and, with held-out rows, valid_loss and valid_accuracy.

    Raises
    ------
    FloatingPointError
        If the loss stops being finite.
    """
    devices = [plan.device] if plan.device.startswith("cuda") else []
    with one_thread(), torch.random.fork_rng(devices):
        torch.manual_seed(seed)
        net = _network(module, module_parameters, training, held_out, plan)
        net.fit(training)
        state = {
            name: tensor.detach().cpu().numpy().copy()
            for name, tensor in net.module_.state_dict().items()
        }
    kept = ("epoch", "train_loss", "valid_loss", "valid_accuracy")
    return state, [{key: row[key] for key in kept if key in row} for row in net.history.to_list()]


def _network(
    module: type[nn.Module],
    module_parameters: dict[str, Any],
    training: TrainingData,
    held_out: TrainingData | None,
    plan: TrainingPlan,
) -> NeuralNet:
    rows_per_epoch = plan.rows_per_epoch or len(training)
    n_batches = -(-rows_per_epoch // plan.batch_size)
    decay = LRScheduler(
        torch.optim.lr_scheduler.StepLR,
        step_size=plan.epochs_per_decay,
        gamma=plan.learning_rate_decay,
    )
    callbacks: list[tuple[str, Callback]] = [
        ("watch", _Watch(plan.max_epochs, n_batches, plan.verbose)),
        ("decay", decay),
    ]
    stop = None
    if plan.patience is not None:
        stop = EarlyStopping(
            "valid_loss", patience=plan.patience, threshold=0.0, load_best=True, sink=_no_output
        )
        callbacks.append(("stop", stop))
    if plan.checkpoint is not None:
        checkpoint = Checkpoint(plan.checkpoint, plan.provenance, decay, stop)
        callbacks.append(("checkpoint", checkpoint))
    return NeuralNet(
        module,
        criterion=_WeightedLoss,
        optimizer=torch.optim.Adam,
        optimizer__fused=True,
        lr=plan.learning_rate,
        max_epochs=plan.max_epochs,
        batch_size=plan.batch_size,
        iterator_train=_Batches,
        iterator_train__shuffle=True,
        iterator_train__balanced=plan.balanced_batches,
        iterator_train__n_rows=rows_per_epoch,
        iterator_valid=_Batches,
        iterator_valid__batch_size=_rows_per_forward(module),
        train_split=None if held_out is None else predefined_split(held_out),
        callbacks=callbacks,
        callbacks__print_log=None,
        device=plan.device,
        verbose=0,
        **{f"module__{name}": value for name, value in module_parameters.items()},
    )


def _no_output(*text: object) -> None:
    pass


def _rows_per_forward(module: Any) -> int:
    return int(getattr(module, "rows_per_forward", ROWS_PER_FORWARD))


def restore(
    module: type[nn.Module], module_parameters: dict[str, Any], state: State, device: str
) -> nn.Module:
    """Build a trained module for inference from its state, on the CPU if the device is not here."""
    restored: Any = module(**module_parameters)
    restored.load_state_dict({name: torch.from_numpy(array) for name, array in state.items()})
    here = device if torch.cuda.is_available() or not device.startswith("cuda") else "cpu"
    restored.eval().to(here)
    if hasattr(restored, "for_inference"):
        restored.for_inference()
    return restored


def logits(module: nn.Module, rows: NDArray[Any]) -> NDArray[np.float32]:
    """Evaluate a restored module on (n, n_features) rows, in large batches; shape (n,)."""
    device = next(module.parameters()).device
    n_rows = _rows_per_forward(module)
    with torch.inference_mode():
        parts = [
            module(_tensor(rows[first : first + n_rows]).to(device)).reshape(-1).cpu()
            for first in range(0, len(rows), n_rows)
        ]
    return torch.cat(parts).numpy()


def _tensor(rows: NDArray[Any]) -> Tensor:
    return torch.from_numpy(np.require(rows, requirements=["C", "W"]))
