"""Reading estimators from files, with messages that say what is wrong with a file."""

from __future__ import annotations

import os
from typing import Any

import joblib


class ModelFileError(ValueError):
    """A model file can't be used; the message says why and what to do."""


def load_estimator(path: str | os.PathLike[str]) -> Any:
    """Load an estimator that ``joblib.dump`` saved.

    Does what ``joblib.load`` does, and says what is wrong with a file that can't be loaded. Loading
    runs code that the file names, as with any pickle: load only files that you trust.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    estimator : object

    Raises
    ------
    ModelFileError
        If the file is truncated or no joblib file, holds no estimator, was saved in another
        format, or needs a class that can't be imported here.
    FileNotFoundError
        If there is no such file.
    """
    try:
        estimator = joblib.load(path)
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
    if not hasattr(estimator, "predict"):
        raise ModelFileError(
            f"{os.fspath(path)} must hold an estimator, which has the method predict, got "
            f"{type(estimator).__name__}."
        )
    return estimator
