"""Checkpoints of a training, from which it goes on as if it had never stopped."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from skorch import NeuralNet
from skorch.callbacks import Callback
from skorch.history import History

from reliability.persistence import ModelFileError

FORMAT_VERSION = 1
_BYTES_AT_ONCE = 2**26


def digest(arrays: Iterable[NDArray[Any]]) -> str:
    """Return a digest of arrays, read piece by piece."""
    total = hashlib.blake2b(digest_size=16)
    for array in arrays:
        total.update(f"{array.dtype.str} {array.shape}".encode())
        n_rows = max(1, _BYTES_AT_ONCE // max(1, array[:1].nbytes))
        for first in range(0, len(array), n_rows):
            total.update(np.ascontiguousarray(array[first : first + n_rows]).data)
    return total.hexdigest()


class Checkpoint(Callback):
    """Writes all that a training needs to go on, after each epoch, and reads it at the start.

    It must be the last callback. It keeps the state of ``decay`` and of ``stop``.

    Parameters
    ----------
    path : path-like
    provenance : dict
        What the training is determined by, as strings and numbers: a file of another is refused.
    decay : LRScheduler
    stop : EarlyStopping or None
    """

    def __init__(
        self, path: str | os.PathLike[str], provenance: dict[str, Any], decay: Any, stop: Any
    ) -> None:
        self.path = Path(path)
        self.provenance = provenance
        self.decay = decay
        self.stop = stop

    def on_train_begin(self, net: NeuralNet, **kwargs: Any) -> None:
        """Go on from the file, if there is one."""
        if self.path.exists():
            self._restore(net, self._read(net.max_epochs))

    def on_epoch_end(self, net: NeuralNet, **kwargs: Any) -> None:
        """Write the file."""
        self._write(net)

    def on_train_end(self, net: NeuralNet, **kwargs: Any) -> None:
        """Write the file of a training that stopped early, which skips the callbacks behind."""
        if self._has_stopped():
            self._write(net)

    def _has_stopped(self) -> bool:
        return self.stop is not None and self.stop.misses_ >= self.stop.patience

    def _write(self, net: NeuralNet) -> None:
        state = {
            "format_version": FORMAT_VERSION,
            "provenance": self.provenance,
            "module": net.module_.state_dict(),
            "optimizer": net.optimizer_.state_dict(),
            "decay": _plain(self.decay.lr_scheduler_.state_dict()),
            "stop": None if self.stop is None else _stop_state(self.stop),
            "history": [_plain(row) for row in net.history.to_list()],
            "generator": torch.get_rng_state(),
            "device_generator": _device_generator(net.device),
        }
        partial = self.path.with_name(self.path.name + ".partial")
        torch.save(state, partial)
        os.replace(partial, self.path)

    def _read(self, max_epochs: int) -> dict[str, Any]:
        try:
            state: dict[str, Any] = torch.load(self.path, map_location="cpu", weights_only=True)
            found, version = state["provenance"], state["format_version"]
        except Exception as error:
            raise ModelFileError(
                f"{self.path} is truncated or no checkpoint ({error!r}); delete it to train anew."
            ) from error
        if version != FORMAT_VERSION:
            raise ModelFileError(
                f"{self.path} has the checkpoint format {version}, expected {FORMAT_VERSION}; "
                "delete it to train anew."
            )
        differing = [
            f"{name} = {found.get(name)!r} where this fit has {wanted!r}"
            for name, wanted in self.provenance.items()
            if found.get(name) != wanted
        ]
        if differing:
            raise ModelFileError(
                f"{self.path} is the checkpoint of another training: {'; '.join(differing)}. "
                "Give the data and parameters that it was begun with, or another path."
            )
        if len(state["history"]) > max_epochs:
            raise ModelFileError(
                f"{self.path} holds {len(state['history'])} epochs, more than max_epochs = "
                f"{max_epochs}. Raise max_epochs, or give another path."
            )
        return state

    def _restore(self, net: NeuralNet, state: dict[str, Any]) -> None:
        net.module_.load_state_dict(state["module"])
        net.optimizer_.load_state_dict(state["optimizer"])
        self.decay.lr_scheduler_.load_state_dict(state["decay"])
        net.history = History({"batches": [], **row} for row in state["history"])
        if self.stop is not None:
            for name, value in state["stop"].items():
                setattr(self.stop, name, value)
        net.max_epochs = 0 if self._has_stopped() else net.max_epochs - len(net.history)
        torch.set_rng_state(state["generator"])
        if state["device_generator"] is not None:
            torch.cuda.set_rng_state(state["device_generator"], net.device)


def _device_generator(device: str) -> torch.Tensor | None:
    return torch.cuda.get_rng_state(device) if device.startswith("cuda") else None


def _stop_state(stop: Any) -> dict[str, Any]:
    names = ("misses_", "dynamic_threshold_", "best_epoch_", "best_model_weights_")
    return _plain({name: deepcopy(getattr(stop, name)) for name in names})


def _plain(row: dict[str, Any]) -> dict[str, Any]:
    """Turn numpy's numbers into Python's, which load without running any code."""
    return {
        name: value.item() if isinstance(value, np.generic) else value
        for name, value in row.items()
        if name != "batches"
    }
