"""Reading models back, with words for what can be wrong with a file."""

from __future__ import annotations

import os
from typing import Any

import joblib


class ModelFileError(ValueError):
    """A model file can't be used; the message says why and what to do."""


def load_estimator(path: str | os.PathLike[str]) -> Any:
    """Load an estimator that ``joblib.dump`` saved, or say why it can't be.

    The same as ``joblib.load`` for a sound file. Like any pickle, load only files that you trust.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    estimator : object

    Raises
    ------
    ModelFileError
        If the file is truncated or no joblib file, was saved by another format version, or needs
        a class that can't be imported here.
    FileNotFoundError
        If there is no such file.
    """
    try:
        return joblib.load(path)
    except (ModelFileError, FileNotFoundError):
        raise
    except (ImportError, AttributeError) as error:
        raise ModelFileError(
            f"{os.fspath(path)} needs something that can't be imported here ({error}); install "
            "it, or move the class out of the script or notebook that saved the model."
        ) from error
    except Exception as error:
        raise ModelFileError(
            f"{os.fspath(path)} is truncated or no joblib file ({error!r}); copy it again, or "
            "train and save the model again."
        ) from error
