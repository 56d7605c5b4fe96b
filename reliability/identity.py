"""What data were made from, in words: descriptions that say whether two things are the same."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import math
from enum import Enum
from pathlib import PurePath
from typing import Any

import numpy as np

from reliability.pickled_content import content_digest, pickled_state
from reliability.reachable_code import code_digest

# Parameters of estimators and planners on which what they answer does not depend.
_IRRELEVANT = frozenset({"random_state", "n_jobs", "verbose"})
_MOST_NUMBERS = 64


def describe(thing: Any) -> Any:
    """Describe something by what a user can see and state, in words and numbers.

    Two things with the same description are the same for a collection: a thing and its copy that
    went through a file are, and so are a class that was run as a script and the same class
    imported, or ``1e-3`` and ``np.float64(1e-3)``.

    - An object with a method ``describe()`` is described by its class and by what that returns.
    - Estimators and other objects with ``get_params`` are described by their class, their
      parameters (other than ``random_state``, ``n_jobs`` and ``verbose``) and a digest of
      what ``fit`` added.
    - Other objects are described by their class and the parameters of its constructor, which are
      found in attributes of the same names, and by public attributes that are numbers, strings
      or arrays. If a parameter is not among the attributes, a digest of the object's state is
      added.

    Parameters
    ----------
    thing : object
        Anything that pickles.

    Returns
    -------
    description : None, bool, int, float, str, list or dict
        As JSON can hold it.

    Raises
    ------
    ValueError
        If the object neither pickles nor has a method ``describe()``.
    """
    if isinstance(thing, float) and math.isnan(thing):  # which is not equal to itself
        return "nan"
    if thing is None or isinstance(thing, bool | int | float | str):
        return thing.value if isinstance(thing, Enum) else thing
    if isinstance(thing, np.longdouble | np.clongdouble):  # whose item is itself
        return describe(thing.astype(np.complex128 if np.iscomplexobj(thing) else np.float64))
    if isinstance(thing, np.generic):
        return describe(thing.item())
    if isinstance(thing, np.ndarray):
        return _described_array(thing)
    if isinstance(thing, list | tuple):
        return [describe(part) for part in thing]
    if isinstance(thing, dict):
        return {str(key): describe(value) for key, value in thing.items()}
    if isinstance(thing, set | frozenset):
        return sorted((describe(part) for part in thing), key=repr)
    if isinstance(thing, PurePath | slice | range | bytes | complex):
        return str(thing)
    if isinstance(thing, Enum):
        return thing.name
    if isinstance(thing, functools.partial):
        return {"partial": describe(thing.func), "of": describe([thing.args, thing.keywords])}
    if isinstance(thing, type) or inspect.isroutine(thing):
        return {"name": thing.__qualname__, "code": code_digest(thing)}
    return _described_object(thing)


def describe_planner(planner: Any) -> dict[str, Any]:
    """Describe a planner apart from its system and its random state."""
    if hasattr(planner, "get_params"):
        found = _described_parameters(planner, _IRRELEVANT | {"system"})
        return {"class": type(planner).__qualname__, "parameters": found}
    attributes = {k: v for k, v in vars(planner).items() if k not in ("system", "random_state")}
    return {"class": type(planner).__qualname__, "attributes": describe(attributes)}


def _described_array(array: np.ndarray) -> Any:
    if array.size <= _MOST_NUMBERS and array.dtype.kind in "biufU":
        return array.tolist()
    return {"array": str(array.dtype), "shape": list(array.shape), "digest": content_digest(array)}


def _described_object(thing: Any) -> dict[str, Any]:
    found: dict[str, Any] = {"class": type(thing).__qualname__}
    try:
        if hasattr(thing, "describe"):
            return {**found, "described": describe(thing.describe())}
        if hasattr(thing, "get_params"):
            return {**found, **_described_estimator(thing)}
        if dataclasses.is_dataclass(thing):
            names = [field.name for field in dataclasses.fields(thing)]
            return {**found, **{name: describe(getattr(thing, name)) for name in names}}
        return {**found, **_described_attributes(thing)}
    except TypeError as error:
        raise ValueError(
            f"{thing!r} can't be described, because a part of it does not pickle ({error}). Leave "
            "that part out in __getstate__, or give the class a method describe() that returns "
            "its parameters."
        ) from error


def _described_estimator(estimator: Any) -> dict[str, Any]:
    found = {"parameters": _described_parameters(estimator, _IRRELEVANT)}
    names = estimator.get_params(deep=False)
    fitted = {k: v for k, v in pickled_state(estimator).items() if k not in names}
    return {**found, "fitted": content_digest(fitted)} if fitted else found


def _described_parameters(thing: Any, left_out: frozenset[str]) -> dict[str, Any]:
    parameters = thing.get_params(deep=False)
    return {name: describe(value) for name, value in parameters.items() if name not in left_out}


def _described_attributes(thing: Any) -> dict[str, Any]:
    state = pickled_state(thing)
    found, complete = {}, True
    for name in _constructor_parameters(type(thing)):
        attribute = name if name in state else f"_{name}"
        complete &= attribute in state
        if attribute in state:
            found[name] = describe(state[attribute])
    for name, value in state.items():
        if not name.startswith("_") and name not in found and _is_plain(value):
            found[name] = describe(value)
    return found if complete else {**found, "state": content_digest(thing)}


def _constructor_parameters(kind: type) -> list[str]:
    if kind.__init__ is object.__init__:  # type: ignore[misc]
        return []
    return list(inspect.signature(kind.__init__).parameters)[1:]  # type: ignore[misc]


def _is_plain(value: Any) -> bool:
    return value is None or isinstance(value, bool | int | float | str | np.generic | np.ndarray)
