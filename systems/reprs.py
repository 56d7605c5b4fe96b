"""Values in a few words, for how objects are shown."""

from __future__ import annotations

from typing import Any

import numpy as np

_MOST_NUMBERS = 12
_MOST_CHARACTERS = 200


def shortened(value: Any) -> str:
    """Show a value in one line: small arrays with all their numbers, others by their shape."""
    if isinstance(value, np.ndarray) and value.size > _MOST_NUMBERS:
        return f"<array of shape {value.shape}>"
    line = " ".join(repr(value).split())
    return line if len(line) <= _MOST_CHARACTERS else f"{line[:_MOST_CHARACTERS]}…"
