"""Odd values for the arguments of public functions, and what may come of them.

A *door* is a public function or method with arguments that are right. Each test replaces one of
these by something odd, and what comes of it has to be a sane result, or an error of a documented
kind whose message names the argument. ``FUZZ_EXAMPLES=1000 pytest tests/test_fuzz_*.py`` tries more
odd values than the 25 per argument that the suite tries, and prints how many came to what.
"""

from __future__ import annotations

import os
import re
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from sklearn.exceptions import NotFittedError

from systems import SimulationDivergedError

EXAMPLES = int(os.environ.get("FUZZ_EXAMPLES", "25"))
# What came of how many cases, by door.
OUTCOMES: dict[str, Counter[str]] = {}

FLOATS = [0.0, 0.5, -1.0, 1.0, 3.0, np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-320]
INTEGERS = [0, 1, 2, -1, 100]
FILLINGS: dict[str, list[Any]] = {
    **dict.fromkeys(["f8", ">f8", "f4", "f2", "g"], FLOATS),
    **dict.fromkeys(["i8", "i4", "i1"], INTEGERS),
    **dict.fromkeys(["u8", "u1", "?"], INTEGERS[:2]),
    "c16": [0, 1j, np.nan],
    "O": [0, 0.5, None, "a", Fraction(1, 2), [1], 2**70, object],
    "U3": ["a", "1", "", "nan"],
    "S3": [b"a", b"1"],
    "M8[s]": [0, 1],
    "m8[s]": [0, 1],
}
WRONG_TYPES = [None, "", "a", "1", b"a", [], (), {}, {"a": 1}, set(), object(), int, Ellipsis]
NO_COUNTS = [0, -1, 0.5, 2.0, np.nan, np.inf, True, np.float64(2), np.bool_(True), 1j, [1]]
NUMBERS = [*FLOATS, *INTEGERS, True, 2**64, -(2**64), 10**400, Fraction(1, 3), 1j, np.ones(1)]
NUMPY_NUMBERS = [
    *(np.float64(value) for value in FLOATS),
    *(np.float32(value) for value in (0.5, np.nan, np.inf)),
    *(np.float16(0.5), np.int64(1), np.uint8(1), np.int8(-1), np.bool_(True), np.array(0.5)),
]

wrong_types = st.sampled_from(WRONG_TYPES)
numbers = st.sampled_from([*NUMBERS, *NUMPY_NUMBERS]) | st.floats() | st.integers() | wrong_types
# For numbers of things to do, of which a large one takes long.
counts = st.sampled_from([*NO_COUNTS, 1, np.int64(2), np.uint8(1), np.int8(2)]) | wrong_types
choices = st.sampled_from([0, 1.5, True, np.nan, np.ones(2), np.str_("a")]) | wrong_types


@st.composite
def arrays(draw: st.DrawFn, *shape: int) -> Any:
    """Arrays of a shape or of one near to it, of any dtype, and lists of the same."""
    near = [shape] * 4 + [(), shape[1:], (1, *shape), (0, *shape[1:]), (*shape[:-1], 0)]
    near += [(*shape[:-1], shape[-1] + 1), (shape[0] + 1, *shape[1:]), (1, *shape[1:])]
    size = draw(st.sampled_from(near))
    dtype = draw(st.sampled_from(["f8", "f8", "f8", *FILLINGS]))
    count = int(np.prod(size))
    values = draw(
        st.lists(st.sampled_from(FILLINGS[dtype]), min_size=count, max_size=count)
        | st.just([FILLINGS[dtype][1]] * count)
    )
    array = np.empty(count, dtype=dtype)
    with np.errstate(over="ignore"):
        for i, value in enumerate(values):
            array[i] = value
    array = array.reshape(size)
    return draw(st.sampled_from([array, array, array.tolist()])) if dtype[0] != "m" else array


def rows(*shape: int) -> st.SearchStrategy[Any]:
    """Arrays as :func:`arrays` makes them, and what is none."""
    return arrays(*shape) | arrays(*shape) | arrays(*shape) | numbers


@dataclass(frozen=True)
class Door:
    """A public function, how to call it, and what to give it instead.

    Attributes
    ----------
    call : callable
        Takes the arguments by their names.
    right : callable
        Makes arguments that are right, as a dict.
    odd : dict of str to strategy
        What to give for each argument.
    errors : tuple of exception types
        What may be raised.
    share : float
        Of the usual number of examples; less where a call takes long.
    names : dict of str to str
        How messages name an argument, if not by its name.
    """

    call: Callable[..., Any]
    right: Callable[[], dict[str, Any]]
    odd: dict[str, st.SearchStrategy[Any]]
    errors: tuple[type[Exception], ...] = (ValueError, NotFittedError, SimulationDivergedError)
    share: float = 1.0
    names: dict[str, str] = field(default_factory=dict)


def cases(doors: dict[str, Door]) -> Any:
    """Parametrize a test by each argument of each door."""
    each = [(name, argument) for name, door in doors.items() for argument in door.odd]
    return pytest.mark.parametrize(("name", "argument"), each, ids=map("-".join, each))


def try_odd_values(doors: dict[str, Door], name: str, argument: str) -> None:
    """Call a door with many odd values for an argument."""
    door = doors[name]

    @settings(
        max_examples=max(5, round(EXAMPLES * door.share)),
        derandomize=True,
        deadline=None,
        database=None,
        phases=(Phase.generate,),
        suppress_health_check=list(HealthCheck),
    )
    @given(value=door.odd[argument])
    def check(value: Any) -> None:
        outcome = _outcome(door, argument, value)
        OUTCOMES.setdefault(name, Counter())[outcome] += 1

    check()


def try_numpy_numbers(door: Door) -> None:
    """Call a door with numpy's scalars for its numbers, which must do as well."""
    for argument, value in door.right().items():
        for scalar in numpy_scalars(value):
            door.call(**{**door.right(), argument: scalar})


def numpy_scalars(value: Any) -> list[Any]:
    """Return numpy's scalars that equal a Python number; none for anything else."""
    if type(value) is int:
        return [np.int64(value), np.int32(value), np.uint8(value)] if 0 <= value < 256 else []
    if type(value) is float:
        return [t(value) for t in (np.float64, np.float32, np.float16) if float(t(value)) == value]
    return [np.bool_(value)] if type(value) is bool else []


def _outcome(door: Door, argument: str, value: Any) -> str:
    try:
        with warnings.catch_warnings():
            # Overflow of huge numbers, and what is told of a small data set.
            warnings.simplefilter("ignore")
            result, complaint = door.call(**{**door.right(), argument: value}), None
    except door.errors as error:
        result, complaint = None, error
    if complaint is None:
        assert _is_extreme(value) or not _has_nan(result), f"NaN of finite arguments: {result!r}"
        return "answered"
    # These name the file, and what the simulator said.
    if isinstance(complaint, OSError | SimulationDivergedError):
        return type(complaint).__name__
    named = door.names.get(argument, argument)
    assert re.search(rf"\b({named})\b", str(complaint)), f"{complaint!r} does not name {named}"
    return type(complaint).__name__


def _is_extreme(value: Any) -> bool:
    """Say whether values are so large, or no numbers, that NaN may come of them."""
    try:
        if np.iscomplexobj(value):
            return True
        array = np.asarray(value, dtype=np.float64)
    except (AttributeError, TypeError, ValueError, OverflowError):
        return False
    return not (np.abs(array) < 1e100).all()


def _has_nan(result: Any) -> bool:
    if isinstance(result, tuple):
        return any(map(_has_nan, result))
    is_float = isinstance(result, np.ndarray | np.floating) and result.dtype.kind == "f"
    return bool(is_float and np.isnan(result).any())
