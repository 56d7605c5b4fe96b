"""Worker processes that end when the process that they work for is gone."""

from __future__ import annotations

import functools
import multiprocessing
import os
import threading
import time

_SECONDS_BETWEEN_LOOKS = 1.0


@functools.cache
def end_with_parent() -> None:
    """Let a worker of joblib's end soon after its parent; does nothing in any other process.

    A parent that is killed can't tell its workers, which would keep their memory, and the work
    that nobody waits for any more, for minutes.
    """
    name = multiprocessing.current_process().name
    # Those of joblib's backends "loky" and "multiprocessing".
    if name.startswith("LokyProcess") or "PoolWorker" in name:
        threading.Thread(target=_watch, args=(os.getppid(),), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_SECONDS_BETWEEN_LOOKS)
    os._exit(1)
