"""Whether plans are being made to learn from, rather than to succeed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_EXPLORING = ContextVar("exploring", default=False)


@contextmanager
def exploring() -> Iterator[None]:
    """Mark the plans made meanwhile, in this thread, as made to learn from."""
    token = _EXPLORING.set(True)
    try:
        yield
    finally:
        _EXPLORING.reset(token)


def is_exploring() -> bool:
    """Say whether the plan that is being made here is to learn from.

    Planners then don't warn of parameters that let Unreliable transitions through.
    """
    return _EXPLORING.get()
