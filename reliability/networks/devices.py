"""Torch devices and threads."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch


def is_available(device: str) -> bool:
    """Tell whether torch can compute on a device, named as in ``torch.device``."""
    try:
        torch.empty(0, device=device)
    except (RuntimeError, AssertionError):  # AssertionError: torch was built without CUDA.
        return False
    return True


def check_device(device: str) -> None:
    """Raise ``ValueError`` unless torch can compute on a device."""
    if not isinstance(device, str) or not is_available(device):
        raise ValueError(
            f'device must be a torch device of this machine, such as "cpu", got {device!r}.'
        )


@contextmanager
def one_thread() -> Iterator[None]:
    """Have torch use one thread, so that sums come out the same whatever the number of cores."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
