"""A digest of what an object holds, which does not change when it is pickled and loaded."""

from __future__ import annotations

import hashlib
import types
from enum import Enum
from functools import cached_property, partial
from typing import Any

import numpy as np

# scikit-learn adds its version to what it pickles; the same weights are the same in another.
_NOT_CONTENT = frozenset({"_sklearn_version"})
_CODE = (
    type,
    types.FunctionType,
    types.BuiltinFunctionType,
    types.MethodDescriptorType,
    np.ufunc,
)


def content_digest(thing: Any) -> str:
    """Return 16 hexadecimal digits that depend on what an object holds.

    Unlike ``joblib.hash`` it does not depend on which parts are shared, on the order of a dict,
    on unused bytes of structured arrays, or on values that a ``cached_property`` filled in.
    Classes and functions count by their names.

    Parameters
    ----------
    thing : object
        Anything that pickles.

    Raises
    ------
    TypeError
        If a part of it doesn't pickle.
    """
    return _Walk().digest(thing).hex()


def pickled_state(thing: Any) -> dict[str, Any]:
    """Return the attributes that an object would be pickled with.

    Raises
    ------
    TypeError
        If it doesn't pickle.
    """
    reduced = thing.__reduce_ex__(4)
    state = reduced[2] if not isinstance(reduced, str) and len(reduced) > 2 else None
    if isinstance(state, tuple) and len(state) == 2:  # attributes and slots
        state = {**(state[0] or {}), **(state[1] or {})}
    if not isinstance(state, dict):
        return {}
    return {name: value for name, value in state.items() if _is_content(type(thing), name)}


def _is_content(kind: type, name: Any) -> bool:
    filled_in = isinstance(name, str) and isinstance(getattr(kind, name, None), cached_property)
    return name not in _NOT_CONTENT and not filled_in


class _Walk:
    """One pass over an object; remembers what it has seen, so that cycles end."""

    def __init__(self) -> None:
        # The objects are kept too: an id is free for another once its object is gone.
        self._seen: dict[int, tuple[Any, bytes]] = {}

    def digest(self, thing: Any) -> bytes:
        if thing is None or isinstance(thing, bool | np.bool_ | int | float | complex | np.number):
            plain = thing.item() if isinstance(thing, np.generic) else thing
            return _hash(type(plain).__name__, repr(plain))
        if isinstance(thing, str | bytes | bytearray):
            return _hash("text", repr(thing))
        if isinstance(thing, Enum):
            return _hash("enum", type(thing).__qualname__, thing.name)
        if isinstance(thing, _CODE):
            return _hash(
                "code", thing.__qualname__ if hasattr(thing, "__qualname__") else repr(thing)
            )
        if id(thing) not in self._seen:
            self._seen[id(thing)] = thing, b"cycle"
            self._seen[id(thing)] = thing, self._parts(thing)
        return self._seen[id(thing)][1]

    def _parts(self, thing: Any) -> bytes:
        if isinstance(thing, np.dtype):
            return _hash("dtype", repr(thing))
        if isinstance(thing, np.ndarray):
            return self._array(thing)
        if isinstance(thing, dict):
            return self._dict("dict", thing)
        if isinstance(thing, list | tuple):
            return _hash("sequence", *(self.digest(value) for value in thing))
        if isinstance(thing, set | frozenset):
            return _hash("set", *sorted(self.digest(value) for value in thing))
        if isinstance(thing, np.random.RandomState):  # apart from what it was once seeded with
            return self._dict("random numbers", thing.get_state(legacy=False))
        if hasattr(thing, "get_tree_stats"):  # scikit-learn's trees of neighbours count their calls
            return _hash("neighbours", *map(self.digest, map(np.asarray, thing.get_arrays())))
        return self._object(thing)

    def _array(self, array: np.ndarray) -> bytes:
        if array.dtype.names is not None:  # field by field, without the bytes between fields
            fields = (self._array(np.asarray(array[name])) for name in array.dtype.names)
            return _hash("fields", repr(array.dtype.names), *fields)
        if array.dtype.hasobject:
            return _hash("objects", repr(array.shape), *map(self.digest, array.ravel().tolist()))
        content = np.ascontiguousarray(array).tobytes()
        return _hash("array", array.dtype.str, repr(array.shape), content)

    def _dict(self, kind: str, entries: dict[Any, Any]) -> bytes:
        return _hash(
            kind, *sorted(_hash(self.digest(k), self.digest(v)) for k, v in entries.items())
        )

    def _object(self, thing: Any) -> bytes:
        reduced = thing.__reduce_ex__(4)
        if isinstance(reduced, str):
            return _hash("global", reduced)
        arguments = self.digest(reduced[1])
        items = [self.digest(list(part)) for part in reduced[3:5] if part is not None]
        state = reduced[2] if len(reduced) > 2 else None
        if isinstance(thing, partial):  # whose attributes are None until somebody looks at them
            state = (*reduced[2][:3], reduced[2][3] or None)
        attributes = pickled_state(thing) if _holds_attributes(state) else None
        inner = self.digest(state) if attributes is None else self._dict("state", attributes)
        return _hash("object", type(thing).__qualname__, arguments, inner, *items)


def _holds_attributes(state: Any) -> bool:
    slots = isinstance(state, tuple) and len(state) == 2 and isinstance(state[1], dict)
    return isinstance(state, dict) or slots


def _hash(*parts: str | bytes) -> bytes:
    total = hashlib.blake2b(digest_size=8)
    for part in parts:
        content = part.encode() if isinstance(part, str) else part
        total.update(len(content).to_bytes(8, "little") + content)
    return total.digest()
