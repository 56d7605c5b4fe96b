"""Files of named arrays that are written whole and read with care."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

_VERSION = "format_version"


def write_arrays(
    path: str | os.PathLike[str], arrays: dict[str, Any], *, format_version: int
) -> None:
    """Write one npz file; whatever stood there is replaced only when all is written."""
    target = Path(path)
    partial = target.with_name(target.name + ".partial")
    with partial.open("wb") as file:
        named: dict[str, Any] = {_VERSION: np.array(format_version)} | arrays
        np.savez(file, **named)
    os.replace(partial, target)


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
        If the file is no such file, is truncated, or has another format version.
    FileNotFoundError
        If there is no such file.
    """
    try:
        with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
            found = int(arrays.pop(_VERSION))
    except FileNotFoundError:
        raise
    except (zipfile.BadZipFile, KeyError, EOFError, OSError, AttributeError, ValueError) as error:
        raise ValueError(f"{path} is not a whole file of {kind} ({error}).") from error
    if found != format_version:
        raise ValueError(
            f"{path} has the format version {found} and this library reads {format_version}; "
            "make it again, or load it with the version of the library that wrote it."
        )
    if not required <= arrays.keys():
        missing = sorted(required - arrays.keys())
        raise ValueError(f"{path} is not a whole file of {kind} (it lacks {missing}).")
    return arrays
