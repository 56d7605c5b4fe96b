"""Files of a store, one per finished item, written whole and read with care."""

from __future__ import annotations

import errno
import hashlib
import json
import math
import os
import uuid
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

SUFFIX = ".item"
PARTIAL_SUFFIX = ".partial"
_REMEDY = "Remove this file, and it is made again."


class StoreError(ValueError):
    """A file of a store can't be used; the message names it and says what to do."""


@dataclass(frozen=True, eq=False)
class Item:
    """What one unit of work gave.

    Attributes
    ----------
    facts : dict
        What JSON can hold: numbers, strings, lists and dicts.
    arrays : dict of str to ndarray
        Arrays of numbers.
    """

    facts: dict[str, Any]
    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class ItemFiles:
    """The items' files in one folder.

    A file is a digest of the rest, a line of JSON that names the store, the item, its facts and
    the layout of its arrays, and then the arrays' bytes.

    Attributes
    ----------
    folder : Path
    store : str
        Identity of the store that the files belong to.
    """

    folder: Path
    store: str

    def path_of(self, name: str) -> Path:
        """Return the file of an item, whether it is there or not."""
        return self.folder / f"{name}{SUFFIX}"

    def check_writable(self) -> None:
        """Raise ``StoreError`` if no file can be written here, before hours of work are lost."""
        probe = self.folder / f".{uuid.uuid4().hex}{PARTIAL_SUFFIX}"
        try:
            probe.touch(exist_ok=False)
            probe.unlink()
        except OSError as error:
            raise StoreError(
                f"{self.folder} must be a folder that can be written: {error}."
            ) from error

    def read(self, name: str) -> Item | None:
        """Read an item; None if there is no file.

        Raises
        ------
        StoreError
            If the file is damaged, holds another item, or belongs to another store.
        """
        file = self.path_of(name)
        try:
            content = file.read_bytes()
        except FileNotFoundError:
            return None
        digest, _, rest = content.partition(b"\n")
        if digest != digest_of(rest).encode():
            raise StoreError(f"{file} is damaged: its content does not fit its digest. {_REMEDY}")
        line, _, payload = rest.partition(b"\n")
        try:
            header = json.loads(line)
            store, item = header["store"], header["item"]
            read = Item(dict(header["facts"]), _arrays(header["arrays"], payload))
        except Exception as error:  # A digest tells damage, and not what wrote the file.
            raise StoreError(f"{file} is not an item's file ({error!r}). {_REMEDY}") from error
        if store != self.store:
            raise StoreError(
                f"{file} belongs to another store, which was made with other arguments than the "
                f"manifest beside it names. {_REMEDY}"
            )
        if item != name:
            raise StoreError(f"{file} holds {item}, not {name}. {_REMEDY}")
        return read

    def write(self, name: str, item: Item) -> None:
        """Write an item, whole or not at all."""
        as_json(item.facts, "facts")
        names = sorted(item.arrays)
        header = {
            "store": self.store,
            "item": name,
            "facts": item.facts,
            "arrays": [[key, *_layout(item.arrays[key])] for key in names],
        }
        payload = b"".join(np.ascontiguousarray(item.arrays[key]).tobytes() for key in names)
        rest = canonical_json(header) + b"\n" + payload
        put(self.path_of(name), digest_of(rest).encode() + b"\n" + rest)


def put(target: Path, content: bytes | memoryview, *, replace: bool = True) -> None:
    """Write a file under a name of its own, then move it into place.

    Parameters
    ----------
    target : Path
    content : bytes or memoryview
    replace : bool, default=True
        False leaves a file that is there already as it is.
    """
    if target.is_dir():
        raise IsADirectoryError(
            errno.EISDIR, "This path is a folder, and must be a file", str(target)
        )
    partial = target.with_name(f".{target.name}.{uuid.uuid4().hex}{PARTIAL_SUFFIX}")
    try:
        partial.write_bytes(content)
        if replace:
            os.replace(partial, target)
        else:
            _move_unless_there(partial, target)
    finally:
        partial.unlink(missing_ok=True)


def canonical_json(value: Any) -> bytes:
    """Return JSON that is the same for equal values."""
    return json.dumps(value, sort_keys=True, separators=(",", ":")).encode()


def as_json(value: Any, name: str) -> dict[str, Any]:
    """Return a dict as a JSON file gives it back, or raise ``ValueError`` if it can't hold it."""
    if not isinstance(value, dict):
        raise ValueError(f"{name} must be a dict, got {value!r}.")
    try:
        read_back: dict[str, Any] = json.loads(canonical_json(value))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be what JSON can hold, got {value!r} ({error}).") from error
    return read_back


def digest_of(content: bytes) -> str:
    """Return 32 hexadecimal digits that change with the content."""
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def _move_unless_there(partial: Path, target: Path) -> None:
    try:
        os.link(partial, target)
    except FileExistsError:
        return
    except OSError:  # a file system without hard links
        if not target.exists():
            os.replace(partial, target)


def _arrays(layouts: list[Any], payload: bytes) -> dict[str, NDArray[Any]]:
    arrays, begin = {}, 0
    for name, kind, shape in layouts:
        count = math.prod(shape)
        if min(shape, default=0) < 0:
            raise ValueError(f"{name} has the shape {shape}")
        # A copy can be written to, and is aligned.
        array = np.frombuffer(payload, np.dtype(kind), count, begin).reshape(shape).copy()
        arrays[name] = array
        begin += array.nbytes
    return arrays


def _layout(array: NDArray[Any]) -> tuple[str, list[int]]:
    if array.dtype.kind not in "biuf":
        raise ValueError(f"arrays must hold numbers, got {array.dtype}.")
    return array.dtype.str, list(array.shape)
