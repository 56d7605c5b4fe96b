"""Keeping MuJoCo's warnings out of the folder that the user is in."""

from __future__ import annotations

from systems.messages import LOGGER


def log_warnings() -> None:
    """Let MuJoCo hand its warnings to Python's logging, unless the user has told it otherwise.

    By itself it appends them to a file MUJOCO_LOG.TXT in the current folder. A simulation that
    diverges raises an error in any case.
    """
    import mujoco

    if mujoco.get_mju_user_warning() is None:
        mujoco.set_mju_user_warning(_log)


def _log(text: str | bytes) -> None:
    words = text.decode(errors="replace") if isinstance(text, bytes) else text
    LOGGER.info("MuJoCo: %s", words)
