"""Work that is done item by item, kept in a folder, and taken up again after an interruption."""

from __future__ import annotations

import contextlib
import json
import os
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import joblib
from tqdm.auto import tqdm

from reliability.item_files import (
    PARTIAL_SUFFIX,
    SUFFIX,
    Item,
    ItemFiles,
    StoreError,
    as_json,
    canonical_json,
    digest_of,
    put,
)
from reliability.orphans import end_with_parent
from systems.validation import as_path

FORMAT_VERSION = 2
_MANIFEST = "manifest.json"
# A file takes milliseconds to write: one that is an hour old was left by a process that died.
_ABANDONED_AFTER = 3600.0
_MOST_DIFFERENCES = 5


class ResumableStore:
    """A folder with one file per finished item, and a manifest that says what they are.

    Each item's file holds a digest of its content, its own name and the identity of the store,
    so that a file that was damaged, exchanged with another or copied from another store is
    noticed when it is read. Files are written under a name of their own and then moved into
    place: several processes may work on one folder, and a process may be killed at any time.

    Parameters
    ----------
    folder : path-like
        Made if it is not there.
    kind : str
        What the items are, in words, as in "transitions of executed plans".
    description : dict
        All that the items depend on: nested dicts and lists of numbers and strings. A folder
        that was made with another description is refused, and the message names the entries
        that differ.
    adopt : tuple of str, default=()
        Entries of ``description`` whose values are taken from the manifest where there is one,
        such as a random seed that the user left open.

    Attributes
    ----------
    folder : Path
    description : dict
        With adopted values.
    files : ItemFiles
        The items' files; pickles small.

    Raises
    ------
    StoreError
        If the folder was made with another description, or its manifest can't be read.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        kind: str,
        description: dict[str, Any],
        adopt: tuple[str, ...] = (),
    ) -> None:
        # Workers may have been started in another working directory.
        self.folder = as_path(folder).absolute()
        if self.folder.exists() and not self.folder.is_dir():
            raise StoreError(f"{self.folder} must be a folder, and is a file.")
        if not isinstance(kind, str):
            raise ValueError(f"kind must be a string, got {kind!r}.")
        wanted: dict[str, Any] = {"kind": kind, "description": as_json(description, "description")}
        self.folder.mkdir(parents=True, exist_ok=True)
        found = self._claim(wanted)
        for name in adopt:
            wanted["description"][name] = found["description"].get(name)
        differing = differences(found, wanted)
        if differing:
            raise StoreError(
                f"{self.folder} holds data made with other arguments ({_listed(differing)}). "
                "Choose another folder, or remove this one to begin anew."
            )
        self.description: dict[str, Any] = found["description"]
        self.files = ItemFiles(self.folder, digest_of(canonical_json(found)))
        self._remove_abandoned()

    def __repr__(self) -> str:
        return f"<ResumableStore of {len(self.names())} items in {str(self.folder)!r}>"

    @classmethod
    def at(cls, folder: str | os.PathLike[str]) -> ResumableStore:
        """Open a folder as its manifest describes it, to read what is there.

        Raises
        ------
        FileNotFoundError
            If there is no manifest.
        StoreError
            If the manifest can't be read.
        """
        found = _read_manifest(as_path(folder) / _MANIFEST)
        return cls(folder, found["kind"], found["description"])

    def names(self) -> list[str]:
        """Return the names of the finished items, sorted."""
        return sorted(file.name.removesuffix(SUFFIX) for file in self.folder.glob(f"*{SUFFIX}"))

    def read(self, name: str) -> Item | None:
        """Read an item; None if it has not been finished.

        Raises
        ------
        StoreError
            If the file is damaged, holds another item, or belongs to another store.
        """
        return self.files.read(name)

    def discard(self, name: str) -> None:
        """Remove an item, so that it is made again."""
        self.files.path_of(name).unlink(missing_ok=True)

    def _claim(self, wanted: dict[str, Any]) -> dict[str, Any]:
        """Return what the manifest says; write it first if there is none."""
        file = self.folder / _MANIFEST
        if not file.exists():
            content = {"format_version": FORMAT_VERSION, **wanted}
            signed = {**content, "digest": digest_of(canonical_json(content))}
            put(file, (json.dumps(signed, indent=2) + "\n").encode(), replace=False)
        return _read_manifest(file)

    def _remove_abandoned(self) -> None:
        for partial in self.folder.glob(f".*{PARTIAL_SUFFIX}"):
            with contextlib.suppress(FileNotFoundError):
                if time.time() - partial.stat().st_mtime > _ABANDONED_AFTER:
                    partial.unlink()


@dataclass(frozen=True)
class Job:
    """One item to be made, unless it is in a store already.

    Attributes
    ----------
    name : str
        The item's name, which is that of its file.
    compute : callable
        Takes nothing and returns an :class:`Item`; must pickle.
    store : ResumableStore or None
        Where the item is kept; None keeps it in memory only.
    """

    name: str
    compute: Callable[[], Item]
    store: ResumableStore | None = None

    def finished(self) -> Item | None:
        """Read the item if its store has it."""
        return None if self.store is None else self.store.read(self.name)


def run_jobs(
    jobs: Sequence[Job], *, n_jobs: int | None = None, verbose: int = 0, unit: str = "item"
) -> list[Item]:
    """Make the items that are missing, in parallel, and return all of them.

    An item with a store is written by the process that made it, as soon as it is made: whatever
    interrupts a run, all finished items are kept.

    Parameters
    ----------
    jobs : sequence of Job
    n_jobs : int, default=None
        Processes, or whatever the active joblib backend has. They must see the stores' folders.
    verbose : int, default=0
        1 shows a progress bar that counts items.
    unit : str, default="item"
        What the bar calls an item.

    Returns
    -------
    items : list of Item
        In the order of ``jobs``.

    Raises
    ------
    StoreError
        If a file can't be used, or a folder in which something is missing can't be written. All
        files are looked at before any work begins.
    """
    if not isinstance(jobs, Sequence) or not all(isinstance(job, Job) for job in jobs):
        raise ValueError(f"jobs must be a sequence of Job, got {jobs!r}.")
    items = [job.finished() for job in jobs]
    missing = [i for i, item in enumerate(items) if item is None]
    for files in {jobs[i].store.files for i in missing if jobs[i].store is not None}:  # type: ignore[union-attr]
        files.check_writable()
    tasks = (
        joblib.delayed(_run)(i, job.name, job.compute, job.store and job.store.files)
        for i, job in ((i, jobs[i]) for i in missing)
    )
    with tqdm(
        total=len(jobs), initial=len(jobs) - len(missing), unit=unit, disable=not verbose
    ) as bar:
        for i, made in _in_parallel(tasks, n_jobs):
            items[i] = jobs[i].finished() if made is None else made
            bar.update()
    return [_present(item, job) for item, job in zip(items, jobs, strict=True)]


def _run(
    i: int, name: str, compute: Callable[[], Item], files: ItemFiles | None
) -> tuple[int, Item | None]:
    end_with_parent()
    if files is None:
        return i, compute()
    # Another process may have made it since this one looked.
    if files.read(name) is None:
        files.write(name, compute())
    return i, None


def _in_parallel(tasks: Iterable[Any], n_jobs: int | None) -> Iterable[tuple[int, Item | None]]:
    try:
        parallel = joblib.Parallel(n_jobs=n_jobs, return_as="generator_unordered")
    except ValueError:  # a backend that can only return a list, such as Ray's
        parallel = joblib.Parallel(n_jobs=n_jobs)
    results: Iterable[tuple[int, Item | None]] = parallel(tasks)
    return results


def _present(item: Item | None, job: Job) -> Item:
    if item is None:
        raise StoreError(
            f"{job.name} was made and is not in {job.store and job.store.folder}. Was it removed, "
            "or do the worker processes see another folder?"
        )
    return item


def differences(then: Any, now: Any, name: str = "") -> list[str]:
    """Say in words where two descriptions differ.

    Parameters
    ----------
    then, now : object
        Nested dicts and lists of numbers and strings.
    name : str, default=""
        What both describe.

    Returns
    -------
    sentences : list of str
        One for each entry that differs, as in "planner.k: 1.0 then, 2.0 now".
    """
    pairs: list[tuple[Any, Any, Any]]
    if isinstance(then, dict) and isinstance(now, dict):
        keys = [*then, *(key for key in now if key not in then)]
        pairs = [(key, then.get(key, "nothing"), now.get(key, "nothing")) for key in keys]
    elif isinstance(then, list) and isinstance(now, list) and len(then) == len(now):
        pairs = [(i, one, other) for i, (one, other) in enumerate(zip(then, now, strict=True))]
    else:
        same = canonical_json(then) == canonical_json(now)
        return [] if same else [f"{name}: {_shown(then)} then, {_shown(now)} now"]
    prefix = "" if name in ("", "description") else f"{name}."
    return [text for key, one, other in pairs for text in differences(one, other, f"{prefix}{key}")]


def _read_manifest(file: Path) -> dict[str, Any]:
    remedy = (
        "Remove this file, and it is written anew for the arguments that you give; items that "
        "were made with others are then refused."
    )
    try:
        found = dict(json.loads(file.read_bytes()))
        version, digest = found.pop("format_version"), found.pop("digest", None)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise StoreError(f"{file} is not a manifest ({error!r}). {remedy}") from error
    if version != FORMAT_VERSION:
        raise StoreError(
            f"{file} has the format version {version!r} and this library reads {FORMAT_VERSION}. "
            "Choose another folder, or remove this one to begin anew."
        )
    if digest != digest_of(canonical_json({"format_version": version, **found})):
        raise StoreError(f"{file} was changed after it had been written. {remedy}")
    return found


def _shown(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 80 else f"{text[:60]} … {text[-15:]}"


def _listed(sentences: list[str]) -> str:
    shown = "; ".join(sentences[:_MOST_DIFFERENCES])
    n_more = len(sentences) - _MOST_DIFFERENCES
    return shown if n_more <= 0 else f"{shown}; and {n_more} more"
