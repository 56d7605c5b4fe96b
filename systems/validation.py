"""Checks of arguments that all public functions share."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

RandomState = None | int | np.random.SeedSequence | np.random.Generator | np.random.RandomState

# Kinds of numpy types that become float64 without loss of meaning: booleans, integers, floats,
# and Python objects, which may be numbers.
REAL_KINDS = "biufO"
# The largest integer of numpy and torch.
MOST = 2**63 - 1
# How far the product of a rotation matrix with its transpose may be from the identity.
_ROUNDING_OF_ROTATIONS = 1e-6


def as_generator(random_state: RandomState) -> np.random.Generator:
    """Turn a ``random_state`` into a numpy generator.

    Parameters
    ----------
    random_state : None, int, SeedSequence, Generator or RandomState
        None gives a generator that differs in each call. A Generator is returned itself, so that
        the caller's advances. From a RandomState one seed is drawn.

    Returns
    -------
    rng : Generator

    Raises
    ------
    ValueError
        If ``random_state`` is none of these.
    """
    if isinstance(random_state, np.random.Generator):
        return random_state
    if isinstance(random_state, np.random.RandomState):
        return np.random.default_rng(random_state.randint(2**32, dtype=np.uint64))
    if random_state is None or isinstance(random_state, np.random.SeedSequence):
        return np.random.default_rng(random_state)
    if not is_integer(random_state):
        raise ValueError(
            "random_state must be None, an integer, or a numpy SeedSequence, Generator or "
            f"RandomState, got {random_state!r}."
        )
    if random_state < 0:
        raise ValueError(f"random_state must not be negative, got {random_state}.")
    return np.random.default_rng(int(random_state))


def as_seed(random_state: RandomState) -> int:
    """Return a ``random_state`` as an integer: itself if it is one, otherwise a draw from it."""
    rng = as_generator(random_state)
    return int(random_state) if is_integer(random_state) else int(rng.integers(2**63))


def is_integer(value: Any) -> TypeGuard[int]:
    """Say whether a value is an integer of Python or numpy; True and False are not."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def is_number(value: Any) -> TypeGuard[float]:
    """Say whether a value is a real number that a float can hold; True and False are not."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        float(value)
    except OverflowError:
        return False
    return True


def check_count(value: Any, name: str) -> None:
    """Raise ``ValueError`` unless a value is a positive integer that fits into 64 bits."""
    if not is_integer(value) or value < 1:
        raise ValueError(f"{name} must be a positive integer, got {value!r}.")
    if value > MOST:
        raise ValueError(f"{name} must be less than 2**63, got {value!r}.")


def check_finite(value: Any, name: str) -> None:
    """Raise ``ValueError`` unless a value is a finite number."""
    if not is_number(value) or not -np.inf < value < np.inf:
        raise ValueError(f"{name} must be a finite number, got {value!r}.")


def is_number_between(value: Any, low: float, high: float) -> bool:
    """Say whether a value is a number from ``low`` to ``high``, both included."""
    # Comparing with a float16 makes the limits float16 too, for which they may be too large.
    plain = value.item() if isinstance(value, np.generic) else value
    return is_number(plain) and low <= plain <= high


def check_number(value: Any, name: str, low: float, high: float) -> None:
    """Raise ``ValueError`` unless a value is a number from ``low`` to ``high``, both included."""
    if not is_number_between(value, low, high):
        raise ValueError(f"{name} must be a number between {low} and {high}, got {value!r}.")


def as_path(value: Any) -> Path:
    """Return a file's or folder's path, or raise ``ValueError`` if a value can't be one."""
    if not isinstance(value, str | os.PathLike) or not os.fspath(value):
        raise ValueError(f"path must be a string or path-like, and not empty, got {value!r}.")
    if "\0" in os.fsdecode(value):
        raise ValueError(f"path must not hold a null character, got {value!r}.")
    return Path(value)


def check_choice(value: Any, name: str, choices: Iterable[str]) -> None:
    """Raise ``ValueError`` unless a value is one of some words."""
    # Whether an array or a list is among them raises errors of its own.
    if not isinstance(value, str) or value not in choices:
        raise ValueError(f"{name} must be one of {', '.join(choices)}, got {value!r}.")


def check_verbose(value: Any) -> None:
    """Raise ``ValueError`` unless ``verbose`` is a number of 0 or more, or True or False."""
    if isinstance(value, bool | np.bool_):
        return
    if not is_integer(value) or value < 0:
        raise ValueError(f"verbose must be 0 or a positive integer, got {value!r}.")


def check_flag(value: Any, name: str) -> None:
    """Raise ``ValueError`` unless a value is True or False."""
    if not isinstance(value, bool | np.bool_):
        raise ValueError(f"{name} must be True or False, got {value!r}.")


def as_rows(kind: str, n_columns: int, **arrays: Any) -> list[NDArray[np.float64]]:
    """Return arrays as float64, after checking that each has shape (n, n_columns).

    Parameters
    ----------
    kind : str
        What a row is, for the message, such as "poses [x, y, θ]".
    n_columns : int
    **arrays : array-like
        By the names of the arguments.

    Returns
    -------
    rows : list of ndarray of float64
        Those that are so already are returned as they are.

    Raises
    ------
    ValueError
        If the shape differs, or if a value is not a real number.
    """
    return [_as_rows(array, name, n_columns, kind) for name, array in arrays.items()]


def as_row_pair(
    kind: str, n_columns: int, **arrays: Any
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what :func:`as_rows` does, for two arrays that must have as many rows."""
    (one, first), (other, second) = arrays.items()
    rows = _as_rows(first, one, n_columns, kind)
    others = _as_rows(second, other, n_columns, kind)
    if len(rows) != len(others):
        raise ValueError(
            f"{other} must have as many rows as {one}, {len(rows)}, got {len(others)}."
        )
    return rows, others


def _as_rows(array: Any, name: str, n_columns: int, kind: str) -> NDArray[np.float64]:
    rows = as_numbers(array, name)
    if rows.ndim != 2 or rows.shape[1] != n_columns:
        raise ValueError(
            f"{name} must be {kind}, of shape (n, {n_columns}), got the shape {rows.shape}."
        )
    return rows


def as_array(values: ArrayLike, name: str, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Return ``values`` as a float64 array, after checking its shape.

    Parameters
    ----------
    values : array-like
    name : str
        The argument's name, for the message.
    shape : tuple of int or None
        The length that each axis must have; None allows any.

    Returns
    -------
    array : ndarray of float64
        ``values`` itself if it is such an array.

    Raises
    ------
    ValueError
        If the shape differs, or if a value is not a real number.
    """
    array = as_numbers(values, name)
    fits = array.ndim == len(shape) and all(
        want is None or want == got for want, got in zip(shape, array.shape, strict=True)
    )
    if not fits:
        wanted = "(" + ", ".join("any" if want is None else str(want) for want in shape) + ")"
        raise ValueError(f"{name} must have the shape {wanted}, got {array.shape}.")
    return array


def as_finite_array(
    values: ArrayLike, name: str, shape: tuple[int | None, ...]
) -> NDArray[np.float64]:
    """Return what :func:`as_array` does, after checking that it is finite.

    Parameters
    ----------
    values, name, shape
        As in :func:`as_array`.

    Returns
    -------
    array : ndarray of float64

    Raises
    ------
    ValueError
        Also if a value is NaN or infinite.
    """
    array = as_array(values, name, shape)
    if not is_finite(array):
        raise ValueError(f"{name} must be finite, got NaN or infinity in {_shortened(array)}.")
    return array


def as_rotation(values: ArrayLike, name: str) -> NDArray[np.float64]:
    """Return a rotation matrix, exact to a millionth, or raise ``ValueError`` if values are none.

    Parameters
    ----------
    values : array-like of shape (3, 3)
    name : str
        Names the values in messages.
    """
    matrix = as_finite_array(values, name, (3, 3))
    limited = matrix.clip(-2.0, 2.0)  # Squares of huge numbers can't be represented.
    error = np.abs(limited.T @ limited - np.eye(3)).max()
    if error > _ROUNDING_OF_ROTATIONS or np.linalg.det(limited) < 0.0:
        raise ValueError(
            f"{name} must be a rotation matrix, of orthogonal columns of length 1 that are "
            f"right-handed, got {matrix.tolist()}."
        )
    return matrix


def is_finite(array: NDArray[np.float64]) -> bool:
    """Say whether all numbers of an array are finite."""
    # Of the few numbers that planners ask about, a sum of squares is quicker than a look at each,
    # and it is finite only if they are. It is also infinite for numbers beyond 1e154.
    return math.isfinite(np.vdot(array, array)) or bool(np.isfinite(array).all())


def check_within_bounds(
    configuration: NDArray[np.float64], bounds: NDArray[np.float64], name: str
) -> None:
    """Raise ``ValueError`` unless a configuration lies within bounds.

    Parameters
    ----------
    configuration : ndarray of shape (d,) or (n, d)
        One configuration, or several as rows, all of which are checked.
    bounds : ndarray of shape (2, d)
        Lower limits, then upper limits; both are within.
    name : str
        The argument's name, for the message.
    """
    low, high = bounds
    outside = np.atleast_2d((configuration < low) | (configuration > high)).any(axis=1)
    if outside.any():
        first = np.atleast_2d(configuration)[outside][0]
        raise ValueError(
            f"{name} must lie within the bounds {low.tolist()} to {high.tolist()}, "
            f"got {first.tolist()}."
        )


def as_any_array(values: ArrayLike, name: str) -> NDArray[Any]:
    """Return an array of whatever type numpy finds, or raise ``ValueError`` if it finds none."""
    try:
        return np.asarray(values)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be an array, got {values!r}.") from error


def as_numbers(values: ArrayLike, name: str) -> NDArray[np.float64]:
    """Return an array of any shape as float64, or raise ``ValueError`` if it is none of numbers."""
    # Planners ask thousands of times a second, with arrays that are right.
    if type(values) is np.ndarray and values.dtype == np.float64:
        return values
    try:
        array = np.asarray(values)
        if array.dtype.kind in REAL_KINDS:
            return np.asarray(array, dtype=np.float64)
        complaint = None
    except (TypeError, ValueError, OverflowError) as error:
        complaint = error
    raise ValueError(f"{name} must be an array of numbers, got {values!r}.") from complaint


def _shortened(array: NDArray[Any]) -> str:
    return np.array2string(array, threshold=8, edgeitems=2, separator=", ")
