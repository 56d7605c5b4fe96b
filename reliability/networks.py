"""Networks of the classifier: torch modules, and their training through skorch.

The one module of the package that imports torch and skorch.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from skorch import NeuralNet
from skorch.callbacks import Callback, EarlyStopping, LRScheduler
from skorch.helper import predefined_split
from torch import Tensor, nn
from torch.utils.data import TensorDataset
from tqdm.auto import tqdm

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


@dataclass(frozen=True)
class TrainingData:
    """Rows to learn from or to validate on.

    Attributes
    ----------
    rows : ndarray of float32 of shape (n, n_features)
    target : ndarray of float32 of shape (n,)
        1 for the second class, 0 for the first.
    weight : ndarray of float32 of shape (n,)
    """

    rows: NDArray[np.float32]
    target: NDArray[np.float32]
    weight: NDArray[np.float32]

    def as_dataset(self) -> TensorDataset:
        """Return a dataset whose targets are (n, 2): the target and its weight."""
        pairs = np.column_stack([self.target, self.weight]).astype(np.float32)
        return TensorDataset(torch.from_numpy(self.rows), torch.from_numpy(pairs))


@dataclass(frozen=True)
class TrainingPlan:
    """How to train; the fields are the classifier's parameters of the same names."""

    max_epochs: int
    batch_size: int
    learning_rate: float
    learning_rate_decay: float
    epochs_per_decay: int
    patience: int | None
    balanced_batches: bool
    device: str
    verbose: int


class _Batches:
    """Slices of a dataset's tensors, in place of a loader that collates row by row."""

    def __init__(
        self,
        dataset: TensorDataset,
        batch_size: int,
        shuffle: bool = False,
        balanced: bool = False,
    ) -> None:
        self._tensors = dataset.tensors
        self._batch_size = batch_size
        self._shuffle = shuffle
        self._balanced = balanced

    def __len__(self) -> int:
        return -(-len(self._tensors[0]) // self._batch_size)

    def __iter__(self) -> Iterator[tuple[Tensor, ...]]:
        for rows in self._order().split(self._batch_size):
            yield tuple(tensor[rows] for tensor in self._tensors)

    def _order(self) -> Tensor:
        n_rows = len(self._tensors[0])
        if self._balanced:
            target = self._tensors[1][:, 0]
            share = target.mean()
            weight = torch.where(target > 0.5, 1 - share, share)
            return torch.multinomial(weight, n_rows, replacement=True)
        return torch.randperm(n_rows) if self._shuffle else torch.arange(n_rows)


class _WeightedLoss(nn.Module):
    def forward(self, logits: Tensor, pairs: Tensor) -> Tensor:
        loss = nn.functional.binary_cross_entropy_with_logits(
            logits.reshape(-1), pairs[:, 0], reduction="none"
        )
        return (loss * pairs[:, 1]).sum() / pairs[:, 1].sum().clamp_min(1e-12)


class _Watch(Callback):
    """Counts correct answers on the held-out rows, shows progress, stops at divergence."""

    def __init__(self, max_epochs: int, verbose: int) -> None:
        self.max_epochs = max_epochs
        self.verbose = verbose

    def on_train_begin(self, net: NeuralNet, **kwargs: Any) -> None:
        self.bar_ = tqdm(total=self.max_epochs, unit="epoch", disable=not self.verbose)

    def on_epoch_begin(self, net: NeuralNet, **kwargs: Any) -> None:
        self.correct_, self.rows_ = 0, 0

    def on_batch_end(self, net: NeuralNet, batch: Any, training: bool, **kwargs: Any) -> None:
        if not training:
            answers = kwargs["y_pred"].reshape(-1) > 0
            truth = batch[1][:, 0].to(answers.device) > 0.5
            self.correct_ += int((answers == truth).sum())
            self.rows_ += len(truth)

    def on_epoch_end(self, net: NeuralNet, **kwargs: Any) -> None:
        loss = net.history[-1]["train_loss"]
        if not np.isfinite(loss):
            raise FloatingPointError(
                f"Training diverged in epoch {len(net.history)}: the loss is {loss}. "
                "Scale the features, or lower learning_rate."
            )
        shown = {"loss": f"{loss:.4f}"}
        if self.rows_:
            net.history.record("valid_accuracy", self.correct_ / self.rows_)
            shown["held-out accuracy"] = f"{self.correct_ / self.rows_:.4f}"
        self.bar_.set_postfix(shown)
        self.bar_.update()

    def on_train_end(self, net: NeuralNet, **kwargs: Any) -> None:
        self.bar_.close()


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
        net = _network(module, module_parameters, held_out, plan)
        net.fit(training.as_dataset())
        state = {
            name: tensor.detach().cpu().numpy().copy()
            for name, tensor in net.module_.state_dict().items()
        }
    kept = ("epoch", "train_loss", "valid_loss", "valid_accuracy")
    return state, [{key: row[key] for key in kept if key in row} for row in net.history.to_list()]


def _network(
    module: type[nn.Module],
    module_parameters: dict[str, Any],
    held_out: TrainingData | None,
    plan: TrainingPlan,
) -> NeuralNet:
    callbacks: list[tuple[str, Callback]] = [
        ("watch", _Watch(plan.max_epochs, plan.verbose)),
        (
            "decay",
            LRScheduler(
                torch.optim.lr_scheduler.StepLR,
                step_size=plan.epochs_per_decay,
                gamma=plan.learning_rate_decay,
            ),
        ),
    ]
    if plan.patience is not None:
        stop = EarlyStopping(
            "valid_loss", patience=plan.patience, threshold=0.0, load_best=True, sink=_no_output
        )
        callbacks.append(("stop", stop))
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
        iterator_valid=_Batches,
        iterator_valid__batch_size=ROWS_PER_FORWARD,
        train_split=None if held_out is None else predefined_split(held_out.as_dataset()),
        callbacks=callbacks,
        callbacks__print_log=None,
        device=plan.device,
        verbose=0,
        **{f"module__{name}": value for name, value in module_parameters.items()},
    )


def _no_output(*text: object) -> None:
    pass


def restore(
    module: type[nn.Module], module_parameters: dict[str, Any], state: State, device: str
) -> nn.Module:
    """Build a trained module for inference from its state."""
    restored = module(**module_parameters)
    restored.load_state_dict({name: torch.from_numpy(array) for name, array in state.items()})
    return restored.eval().to(device)


def logits(module: nn.Module, rows: NDArray[np.float32], device: str) -> NDArray[np.float32]:
    """Evaluate a restored module on (n, n_features) rows, in large batches; shape (n,)."""
    with torch.inference_mode():
        parts = [
            module(part.to(device)).reshape(-1).cpu()
            for part in torch.from_numpy(rows).split(ROWS_PER_FORWARD)
        ]
    return torch.cat(parts).numpy()
