"""Things listed in a sentence."""

from __future__ import annotations

from collections.abc import Iterable

_MOST_LISTED = 8


def listed(things: Iterable[object]) -> str:
    """Name things one after the other: the first eight, and how many more there are."""
    words = [str(thing) for thing in things]
    more = len(words) - _MOST_LISTED
    return ", ".join(words[:_MOST_LISTED]) + (f" and {more} more" if more > 0 else "")
