"""What of OMPL belongs to the whole process: the sequence of random seeds, and the log level."""

from __future__ import annotations

import os
import threading
from typing import Any

from ompl import util as ou

# Longer sequences of seeds are not replayed: 1,000 seeds take about two milliseconds.
MOST_SEEDS_REPLAYED = 1000


class Silence:
    """Keeps OMPL from logging while any thread searches."""

    lock = threading.Lock()
    _n_searches = 0
    _level: Any = None

    def __enter__(self) -> None:
        with self.lock:
            if Silence._n_searches == 0:
                Silence._level = ou.getLogLevel()
                ou.setLogLevel(ou.LOG_NONE)
            Silence._n_searches += 1

    def __exit__(self, *_: object) -> None:
        with self.lock:
            Silence._n_searches -= 1
            if Silence._n_searches == 0:
                ou.setLogLevel(Silence._level)


class BorrowedSeeds:
    """OMPL's sequence of seeds, begun anew at a seed and afterwards put back to where it was.

    Each of OMPL's random generators takes the next seed of one sequence when it is made. The lock
    keeps threads apart until the sequence is put back. That is done before a search runs, so that
    estimators and systems may themselves plan.

    Parameters
    ----------
    seed : int
        Positive.
    """

    lock = threading.Lock()
    # The seed at which the sequence was begun, where that is not the first one of the process:
    # OMPL only tells the first.
    _begun_at: int | None = None

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._borrowed = False

    def __enter__(self) -> BorrowedSeeds:
        self.lock.acquire()
        try:
            self._borrowed = True
            self._next = ou.RNG().getLocalSeed()
            # OMPL calls a second seeding an error in its log, though it works.
            ou.RNG.setSeed(self._seed)
        except BaseException:  # Ctrl-C must not leave the lock taken for ever
            self._borrowed = False
            self.lock.release()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.give_back()

    def give_back(self) -> None:
        """Put the sequence back to where it was; does nothing the second time."""
        if self._borrowed:
            try:
                self._put_back()
            finally:
                self._borrowed = False
                self.lock.release()

    def _put_back(self) -> None:
        begun_at = BorrowedSeeds._begun_at or ou.RNG.getSeed()
        n_used = _position(self._next, begun_at)
        if n_used is None:
            # The user has seeded again, or has used very many seeds. What follows is another
            # sequence then, but still depends only on the user's seed.
            BorrowedSeeds._begun_at = begun_at = self._next
            n_used = 0
        ou.RNG.setSeed(begun_at)
        for _ in range(n_used):
            ou.RNG()


def _position(seed: int, begun_at: int) -> int | None:
    """Return how many seeds come before ``seed`` in the sequence begun at another seed."""
    ou.RNG.setSeed(begun_at)
    replayed = (ou.RNG().getLocalSeed() for _ in range(MOST_SEEDS_REPLAYED))
    return next((i for i, drawn in enumerate(replayed) if drawn == seed), None)


def _renew_locks() -> None:
    # A child that is forked while another thread holds a lock would wait for that thread for ever.
    Silence.lock = threading.Lock()
    BorrowedSeeds.lock = threading.Lock()


os.register_at_fork(after_in_child=_renew_locks)
