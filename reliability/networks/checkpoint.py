"""Checkpoints of a training, from which it goes on as if it had never stopped."""

from __future__ import annotations

import hashlib
import io
import os
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import torch
from skorch import NeuralNet
from skorch.callbacks import Callback
from skorch.history import History

from reliability.model_files import ModelFileError

# A file begins with this line and the digest of all that follows them.
_FIRST_LINE = b"transition-reliability checkpoint, format 2\n"
_DIGEST_BYTES = 16


class Checkpoint(Callback):
    """Writes all that a training needs to go on, after each epoch, and reads it at the start.

    It must come after all callbacks that have a state.

    Parameters
    ----------
    path : path-like
    identity : dict of str
        What the outcome of the training depends on. The file of a training with another identity
        is refused.
    decay : LRScheduler
        Its state is kept too.
    stop : EarlyStopping or None
        Its state is kept too.
    """

    def __init__(
        self, path: str | os.PathLike[str], identity: dict[str, str], decay: Any, stop: Any
    ) -> None:
        self.path = Path(path)
        self.identity = identity
        self.decay = decay
        self.stop = stop

    def on_train_begin(self, net: NeuralNet, **kwargs: Any) -> None:
        """Go on from the file, if there is one."""
        self._check_writable()
        if not self.path.exists():
            return
        try:
            self._restore(net, self._read(net.max_epochs))
        except (ModelFileError, FileNotFoundError):
            raise
        except Exception as error:  # Each part of the state has errors of its own.
            raise ModelFileError(
                f"{self.path} does not hold the state of a training ({error!r}). Delete it to "
                "train anew."
            ) from error

    def on_epoch_end(self, net: NeuralNet, **kwargs: Any) -> None:
        """Write the file."""
        self._write(net)

    def on_train_end(self, net: NeuralNet, **kwargs: Any) -> None:
        """Write the file of a training that stopped early, in which no later callback is called."""
        if self._has_stopped():
            self._write(net)

    @property
    def _partial(self) -> Path:
        return self.path.with_name(self.path.name + ".partial")

    def _check_writable(self) -> None:
        try:
            if self.path.is_dir():
                raise IsADirectoryError("it is a folder")
            self._partial.write_bytes(b"")
            self._partial.unlink()
        except OSError as error:
            raise ValueError(
                f"checkpoint must be a file that can be written, got {str(self.path)!r}: {error}."
            ) from error

    def _has_stopped(self) -> bool:
        return self.stop is not None and self.stop.misses_ >= self.stop.patience

    def _write(self, net: NeuralNet) -> None:
        state = {
            "identity": self.identity,
            "module": net.module_.state_dict(),
            "optimizer": net.optimizer_.state_dict(),
            "decay": _plain(self.decay.lr_scheduler_.state_dict()),
            "stop": None if self.stop is None else _stop_state(self.stop),
            "history": [_plain(row) for row in net.history.to_list()],
            "generator": torch.get_rng_state(),
            "device_generator": _device_generator(net.device),
        }
        content = io.BytesIO()
        torch.save(state, content)
        data = content.getvalue()
        try:
            self._partial.write_bytes(_FIRST_LINE + _digest(data) + data)
            os.replace(self._partial, self.path)
        finally:
            self._partial.unlink(missing_ok=True)

    def _read(self, max_epochs: int) -> dict[str, Any]:
        state = _checked_state(self.path)
        differing = [
            f"{name} = {state['identity'].get(name)} where this fit has {wanted}"
            for name, wanted in self.identity.items()
            if state["identity"].get(name) != wanted
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


def _checked_state(path: Path) -> dict[str, Any]:
    """Read a file, and raise ``ModelFileError`` if it is not as it was written."""
    content = path.read_bytes()
    if not content.startswith(_FIRST_LINE):
        raise ModelFileError(
            f"{path} is no checkpoint of this version of the library; delete it to train anew."
        )
    begin = len(_FIRST_LINE) + _DIGEST_BYTES
    digest, data = content[len(_FIRST_LINE) : begin], content[begin:]
    if digest != _digest(data):
        raise ModelFileError(
            f"{path} is truncated or damaged: its content is not that which was written. Delete it "
            "to train anew."
        )
    return torch.load(io.BytesIO(data), map_location="cpu", weights_only=True)


def _digest(data: bytes) -> bytes:
    return hashlib.blake2b(data, digest_size=_DIGEST_BYTES).digest()


def _device_generator(device: str) -> torch.Tensor | None:
    return torch.cuda.get_rng_state(device) if device.startswith("cuda") else None


def _stop_state(stop: Any) -> dict[str, Any]:
    names = ("misses_", "dynamic_threshold_", "best_epoch_", "best_model_weights_")
    return _plain({name: deepcopy(getattr(stop, name)) for name in names})


def _plain(row: dict[str, Any]) -> dict[str, Any]:
    """Turn numpy's numbers into Python's, which are read back without running any code."""
    return {
        name: value.item() if isinstance(value, np.generic) else value
        for name, value in row.items()
        if name != "batches"
    }
