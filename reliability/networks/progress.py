"""How far a training has come: a progress bar, and a count of finished epochs."""

from __future__ import annotations

from typing import Any

from skorch import NeuralNet
from skorch.callbacks import Callback
from tqdm.auto import tqdm

from reliability.networks.metrics import WeightedAccuracy


class ProgressBar(Callback):
    """Shows epochs, and the loss and accuracy of the current one, on stderr.

    Parameters
    ----------
    max_epochs : int
    n_batches : int
        Training batches of an epoch.
    """

    def __init__(self, max_epochs: int, n_batches: int) -> None:
        self.max_epochs = max_epochs
        self.n_batches = n_batches

    def on_train_begin(self, net: NeuralNet, **kwargs: Any) -> None:
        """Draw the bar."""
        self.bar_ = tqdm(total=self.max_epochs * self.n_batches, unit="batch")
        self.shown_: dict[str, str] = {}

    def on_epoch_begin(self, net: NeuralNet, **kwargs: Any) -> None:
        """Name the epoch."""
        epoch = len(net.history)
        self.loss_, self.n_rows_ = 0.0, 0
        self.accuracy_ = {True: WeightedAccuracy(), False: WeightedAccuracy()}
        if self.bar_.n == 0:  # Epochs that a checkpoint holds took no time.
            self.bar_.n = self.bar_.initial = (epoch - 1) * self.n_batches
        self.bar_.set_description(f"epoch {epoch}/{self.max_epochs}", refresh=False)

    def on_batch_end(self, net: NeuralNet, batch: Any, training: bool, **kwargs: Any) -> None:
        """Advance by a batch."""
        self.accuracy_[training].add(kwargs["y_pred"], batch[1])
        if training:
            self.loss_ += kwargs["loss"].item() * len(batch[1])
            self.n_rows_ += len(batch[1])
            self._show({"loss": self.loss_ / self.n_rows_, "accuracy": self.accuracy_[True].share})
            self.bar_.update()

    def on_epoch_end(self, net: NeuralNet, **kwargs: Any) -> None:
        """Show the accuracy on the held-out rows."""
        if self.accuracy_[False].total:
            self._show({"held-out accuracy": self.accuracy_[False].share}, refresh=True)

    def on_train_end(self, net: NeuralNet, **kwargs: Any) -> None:
        """Leave the bar as it is."""
        self.bar_.close()

    def _show(self, numbers: dict[str, float], refresh: bool = False) -> None:
        self.shown_ |= {name: f"{number:.4f}" for name, number in numbers.items()}
        self.bar_.set_postfix(self.shown_, refresh=refresh)


class FinishedEpochs(Callback):
    """Counts the epochs of which all callbacks have seen the end; must be the last of them.

    Attributes
    ----------
    n_epochs : int
        Those that a checkpoint held included.
    """

    n_epochs = 0

    def on_train_begin(self, net: NeuralNet, **kwargs: Any) -> None:
        """Count the epochs of the checkpoint."""
        self.n_epochs = len(net.history)

    def on_epoch_end(self, net: NeuralNet, **kwargs: Any) -> None:
        """Count this epoch."""
        self.n_epochs = len(net.history)
