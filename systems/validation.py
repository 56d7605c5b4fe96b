"""Checks of arguments that every door of the library shares."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

RandomState = None | int | np.random.SeedSequence | np.random.Generator | np.random.RandomState


def as_generator(random_state: RandomState) -> np.random.Generator:
    """Turn a ``random_state`` into a numpy generator.

    Parameters
    ----------
    random_state : None, int, SeedSequence, Generator or RandomState
        None draws fresh entropy; a generator is returned as it is, so that it advances;
        a ``RandomState`` is drawn from once.

    Raises
    ------
    ValueError
        If ``random_state`` is none of these.
    """
    if isinstance(random_state, np.random.Generator):
        return random_state
    if isinstance(random_state, np.random.RandomState):
        return np.random.default_rng(random_state.randint(2**32, dtype=np.uint64))
    is_integer = isinstance(random_state, int | np.integer) and not isinstance(random_state, bool)
    if random_state is None or is_integer or isinstance(random_state, np.random.SeedSequence):
        if is_integer and int(random_state) < 0:  # type: ignore[arg-type]
            raise ValueError(f"random_state must not be negative, got {random_state}.")
        return np.random.default_rng(random_state)
    raise ValueError(
        "random_state must be None, an integer, or a numpy SeedSequence, Generator or "
        f"RandomState, got {random_state!r}."
    )


def as_seed(random_state: RandomState) -> int:
    """Return the integer that a ``random_state`` is or gives."""
    if isinstance(random_state, int | np.integer):
        as_generator(random_state)
        return int(random_state)
    return int(as_generator(random_state).integers(2**63))


def check_count(value: Any, name: str) -> None:
    """Raise ``ValueError`` unless a value is a positive integer."""
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or int(value) < 1:
        raise ValueError(f"{name} must be a positive integer, got {value!r}.")


def check_number(value: Any, name: str, low: float, high: float) -> None:
    """Raise ``ValueError`` unless a value is a number between two limits, both allowed."""
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not number or not low <= value <= high:
        raise ValueError(f"{name} must be a number between {low} and {high}, got {value!r}.")


def as_finite_array(
    values: ArrayLike, name: str, shape: tuple[int | None, ...]
) -> NDArray[np.float64]:
    """Return ``values`` as a float64 array of the given shape, or say what is wrong with it.

    Parameters
    ----------
    values : array-like
    name : str
        The argument's name, for the message.
    shape : tuple of int or None
        Expected lengths; None takes any.

    Raises
    ------
    ValueError
        If the shape differs, or a value is NaN, infinite or no number.
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be an array of numbers, got {values!r}.") from error
    fits = array.ndim == len(shape) and all(
        want is None or want == got for want, got in zip(shape, array.shape, strict=True)
    )
    if not fits:
        wanted = "(" + ", ".join("any" if want is None else str(want) for want in shape) + ")"
        raise ValueError(f"{name} must have the shape {wanted}, got {array.shape}.")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, got NaN or infinity in {_shortened(array)}.")
    return array


def check_within_bounds(
    configuration: NDArray[np.float64], bounds: NDArray[np.float64], name: str
) -> None:
    """Raise ``ValueError`` if a configuration, (d,) or (m, d), leaves ``bounds``, (2, d)."""
    low, high = bounds
    outside = np.atleast_2d((configuration < low) | (configuration > high)).any(axis=1)
    if outside.any():
        worst = np.atleast_2d(configuration)[outside][0]
        raise ValueError(
            f"{name} must lie within the bounds {low.tolist()} to {high.tolist()}, "
            f"got {worst.tolist()}."
        )


def _shortened(array: NDArray[Any]) -> str:
    return np.array2string(array, threshold=8, edgeitems=2, separator=", ")
