"""Files of named arrays that are written whole and read with care."""

from __future__ import annotations

import hashlib
import io
import math
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from reliability.item_files import put
from systems.validation import as_path

_VERSION = "format_version"
_DIGEST = "digest"


def write_arrays(
    path: str | os.PathLike[str], arrays: dict[str, Any], *, format_version: int
) -> None:
    """Write one npz file; whatever stood there is replaced only when all is written.

    Raises
    ------
    ValueError
        If an array holds Python objects, which could not be read back.
    """
    named = {name: np.asarray(array) for name, array in arrays.items()}
    named[_VERSION] = np.array(format_version)
    for name, array in named.items():
        if array.dtype.hasobject:
            raise ValueError(f"{name} must be an array of numbers or strings, got objects.")
    named[_DIGEST] = np.array(_digest_of_arrays(named))
    content = io.BytesIO()
    np.savez(content, **named)  # type: ignore[arg-type]
    put(as_path(path), content.getbuffer())


def read_arrays(
    path: str | os.PathLike[str], required: set[str], *, format_version: int, kind: str
) -> dict[str, NDArray[Any]]:
    """Read a file that :func:`write_arrays` wrote.

    Parameters
    ----------
    path : path-like
    required : set of str
        Names of arrays that must be there.
    format_version : int
        The version that the caller reads.
    kind : str
        What the file holds, for messages.

    Raises
    ------
    ValueError
        If the file is no such file, is truncated or damaged, or has another format version.
    FileNotFoundError
        If there is no such file.
    """
    file = as_path(path)
    try:
        arrays = _read_all(file)
        found = int(arrays[_VERSION])
    except FileNotFoundError:
        raise
    except Exception as error:  # Damage shows in each layer: zip, deflate, header, array.
        raise ValueError(f"{path} is not a whole file of {kind} ({error}).") from error
    if found != format_version:
        raise ValueError(
            f"{path} has the format version {found} and this library reads {format_version}; "
            "make it again, or load it with the version of the library that wrote it."
        )
    digest = str(arrays.pop(_DIGEST, "none"))
    if digest != _digest_of_arrays(arrays):
        raise ValueError(f"{path} was changed after it had been written: its digest is another.")
    del arrays[_VERSION]
    if not required <= arrays.keys():
        missing = sorted(required - arrays.keys())
        raise ValueError(f"{path} is not a whole file of {kind} (it lacks {missing}).")
    return arrays


def _read_all(path: Path) -> dict[str, NDArray[Any]]:
    size = path.stat().st_size
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        # Nothing is allocated for what the file only claims to hold.
        if sum(entry.file_size for entry in entries) > size:
            raise ValueError(f"its arrays would be larger than the file's {size} bytes")
        return {
            entry.filename.removesuffix(".npy"): read_array(
                read_entry(archive, entry), entry.filename
            )
            for entry in entries
        }


def read_entry(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> bytes:
    """Read one file of an archive, of which no more is unpacked than it claims to hold.

    Raises
    ------
    ValueError
        If it holds more or less, or is packed in a way that can't be unpacked by parts.
    """
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"{entry.filename} is packed in an unknown way")
    with archive.open(entry) as stream:
        content = stream.read(entry.file_size)
        if len(content) != entry.file_size or stream.read(1):
            raise ValueError(f"{entry.filename} does not hold {entry.file_size} bytes")
    return content


def read_array(content: bytes, name: str) -> NDArray[Any]:
    """Return the array of an npy file, if it is as large as it claims and holds no objects.

    Raises
    ------
    ValueError
    """
    stream = io.BytesIO(content)
    version = npy.read_magic(stream)
    read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read_header(stream)
    n_bytes = math.prod(shape) * dtype.itemsize
    if n_bytes != len(content) - stream.tell() or not dtype.itemsize:
        raise ValueError(f"{name} claims to hold {n_bytes} bytes and does not")
    stream.seek(0)
    return npy.read_array(stream, allow_pickle=False)


def _digest_of_arrays(arrays: dict[str, NDArray[Any]]) -> str:
    total = hashlib.blake2b(digest_size=16)
    for name, array in sorted(arrays.items()):
        total.update(f"{name} {array.dtype.str} {array.shape} ".encode())
        total.update(np.ascontiguousarray(array).tobytes())
    return total.hexdigest()
