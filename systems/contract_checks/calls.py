"""Calls of a system's methods, and checks of what they return."""

from __future__ import annotations

import copy
import pickle
from typing import Any, NoReturn

import numpy as np

from systems.errors import SystemContractError
from systems.system import Array, System

ROUNDING = 1e-9


def fail(system: Any, name: str, complaint: str, cause: Exception | None = None) -> NoReturn:
    """Raise a SystemContractError on a method or an attribute."""
    raise SystemContractError(f"{type(system).__name__}.{name} {complaint}") from cause


def call(system: Any, method: str, *arguments: Any) -> Any:
    """Call a method, and report an exception as a breach of the contract."""
    try:
        return getattr(system, method)(*arguments)
    except Exception as error:
        raise SystemContractError(
            f"{type(system).__name__}.{method} raised {type(error).__name__}: {error}"
        ) from error


def call_with_zero_rows(
    system: System, method: str, *arrays: Array, rest: tuple[Any, ...] = ()
) -> Any:
    """Call a method with zero rows of some arrays, and with the rest of its arguments."""
    none = [array[:0] for array in arrays]
    try:
        return getattr(system, method)(*none, *rest)
    except Exception as error:
        shapes = " and ".join(str(array.shape) for array in none)
        fail(
            system,
            method,
            f"raised {type(error).__name__} for zero rows, arrays of shape {shapes}: {error}. "
            "Planners also ask about none; answer zero rows with zero rows.",
            error,
        )


def check_zero_rows(system: System, method: str, answer: Any, shape: tuple[int, ...]) -> None:
    """Demand that the answer to zero rows is an array of zero rows."""
    if not isinstance(answer, np.ndarray) or answer.shape != shape:
        got = answer.shape if isinstance(answer, np.ndarray) else repr(answer)
        fail(
            system,
            method,
            f"must answer zero rows with zero rows, an array of shape {shape}, got {got}.",
        )


def call_twice(system: Any, method: str, *arguments: Any) -> Any:
    """Call a method twice; demand equal results and that it leaves its arguments as they are."""
    before = copy.deepcopy(arguments)
    result = call(system, method, *arguments)
    again = call(system, method, *copy.deepcopy(before))
    if not same(arguments, before):
        fail(system, method, "changed its arguments in place; it must work on a copy.")
    if not same(result, again):
        fail(system, method, "gave two results for the same arguments; it must be deterministic.")
    return result


def same(one: Any, other: Any) -> bool:
    """Say whether two values are equal, down to the entries of arrays and the attributes."""
    return pickle.dumps(one) == pickle.dumps(other) or _equal_values(one, other)


def _equal_values(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(_equal_values, one, other))
    if hasattr(one, "__dict__"):
        return _equal_values(list(vars(one).values()), list(vars(other).values()))
    return bool(np.all(one == other))


def check_array(system: Any, method: str, array: Any, shape: tuple[int, ...]) -> None:
    """Demand a finite float64 array of the given shape."""
    if not isinstance(array, np.ndarray) or array.dtype != np.float64:
        kind = getattr(array, "dtype", type(array).__name__)
        fail(system, method, f"must return a float64 array, got {kind}.")
    if array.shape != shape:
        fail(system, method, f"must return an array of shape {shape}, got {array.shape}.")
    if not np.isfinite(array).all():
        fail(system, method, f"returned NaN or infinity: {array}.")


def check_booleans(system: System, method: str, array: Any, n_rows: int) -> None:
    """Demand an array with one bool per row."""
    if not isinstance(array, np.ndarray) or array.dtype != np.bool_ or array.shape != (n_rows,):
        got = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else repr(array)
        fail(system, method, f"must return one bool per row, shape ({n_rows},), got {got}.")


def check_rowwise(system: System, method: str, *rows: Array) -> None:
    """Demand that each of three rows gives alone what it gives among the others."""

    def outputs(part: slice) -> tuple[Any, ...]:
        result = call(system, method, *(array[part] for array in rows))
        return result if isinstance(result, tuple) else (result,)

    if not len(rows[0]):
        return
    batch = outputs(slice(0, 3))
    alone = [outputs(slice(i, i + 1)) for i in range(min(3, len(rows[0])))]
    for whole, *parts in zip(batch, *alone, strict=True):
        if not np.allclose(whole, np.concatenate(parts), rtol=0, atol=ROUNDING):
            fail(system, method, "gives other results for rows alone than in a batch.")
