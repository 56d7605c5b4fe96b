"""The library's one logger, and what ``verbose`` asks to be told."""

from __future__ import annotations

import logging
import sys

LOGGER = logging.getLogger("transition-reliability")


def tell(text: str) -> None:
    """Tell the user something that ``verbose`` asked for.

    It is logged at the level INFO if the program shows that level, and otherwise written to the
    standard error stream, above a progress bar that may be there.

    Parameters
    ----------
    text : str
    """
    if LOGGER.isEnabledFor(logging.INFO) and LOGGER.hasHandlers():
        LOGGER.info("%s", text)
        return
    from tqdm.auto import tqdm

    tqdm.write(text, file=sys.stderr)
