"""Loss and accuracy of weighted rows, during training."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from skorch import NeuralNet
from skorch.callbacks import Callback
from torch import Tensor, nn

from reliability.networks.batches import LOSS_WEIGHT, SAMPLE_WEIGHT, TARGET
from reliability.temperature import calibrated_loss

# What early stopping goes by. The plain loss rises as soon as a network grows too sure of itself,
# which can be mended afterwards, although it still learns to tell the labels apart.
CALIBRATED_LOSS = "calibrated_valid_loss"


class WeightedLoss(nn.Module):
    """Binary cross-entropy of logits, averaged with the weights of the rows."""

    def forward(self, logits: Tensor, labels: Tensor) -> Tensor:
        """Return the loss of a batch."""
        loss = nn.functional.binary_cross_entropy_with_logits(
            logits.reshape(-1), labels[:, TARGET], reduction="none"
        )
        weight = labels[:, LOSS_WEIGHT]
        return (loss * weight).sum() / weight.sum().clamp_min(1e-12)


class WeightedAccuracy:
    """The share of right answers so far, by weight."""

    def __init__(self) -> None:
        self.right = self.total = 0.0

    def add(self, logits: Tensor, labels: Tensor) -> None:
        """Count the answers of a batch."""
        right = (logits.reshape(-1).cpu() > 0) == (labels[:, TARGET].cpu() > 0.5)
        weight = labels[:, SAMPLE_WEIGHT].cpu().double()
        self.right += float(weight[right].sum())
        self.total += float(weight.sum())

    @property
    def share(self) -> float:
        """Of the weight seen so far."""
        return self.right / self.total


class EpochMetrics(Callback):
    """Records the weighted loss and held-out accuracy of each epoch, and stops at divergence."""

    def on_epoch_begin(self, net: NeuralNet, **kwargs: Any) -> None:
        """Begin to count."""
        self.held_out_ = WeightedAccuracy()
        self.answers_: list[NDArray[Any]] = []

    def on_batch_end(self, net: NeuralNet, batch: Any, training: bool, **kwargs: Any) -> None:
        """Count a batch."""
        labels = batch[1]
        # skorch averages the losses of an epoch's batches with these as weights.
        name = "train_batch_size" if training else "valid_batch_size"
        net.history.record_batch(name, float(labels[:, LOSS_WEIGHT].sum()))
        if not training:
            logits = kwargs["y_pred"].reshape(-1)
            self.held_out_.add(logits, labels)
            self.answers_.append(np.column_stack([logits.cpu(), labels.cpu()]))

    def on_epoch_end(self, net: NeuralNet, **kwargs: Any) -> None:
        """Record the accuracy, and raise ``FloatingPointError`` if the loss is not finite."""
        row = net.history[-1]
        loss = row["train_loss"]
        if not np.isfinite(loss):
            raise FloatingPointError(
                f"Training diverged in epoch {len(net.history)}: the loss is {loss}. "
                "Scale the features, or lower learning_rate."
            )
        row["batches"].clear()  # One entry per batch would outgrow the network.
        if self.held_out_.total:
            net.history.record("valid_accuracy", self.held_out_.share)
            net.history.record(CALIBRATED_LOSS, self._calibrated_loss())

    def _calibrated_loss(self) -> float:
        logits, labels = np.split(np.concatenate(self.answers_).astype(np.float64), [1], axis=1)
        return calibrated_loss(logits[:, 0], labels[:, TARGET] > 0.5, labels[:, LOSS_WEIGHT])
