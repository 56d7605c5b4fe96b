"""Writing estimators to files and reading them, with messages that say what is wrong."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import joblib
import sklearn

from reliability.item_files import put
from reliability.model_checks import check_model
from reliability.model_files import ModelFileError, model_file, read_model
from systems.extras import needing
from systems.validation import as_path

SKOPS = ".skops"


def save_estimator(estimator: Any, path: str | os.PathLike[str]) -> None:
    """Save a fitted estimator to a file that runs no code when it is loaded.

    Parameters
    ----------
    estimator : classifier
        A :class:`TransitionReliabilityClassifier` of the backends "mlp" and "voxnet", or a
        classifier of scikit-learn, Pipelines and wrappers included. Left out are support vector
        machines, neighbours, and types of your own; save those with ``joblib.dump``.
    path : path-like
        Ends in ``.skops``. A file that stands there is replaced when all is written.

    Raises
    ------
    ValueError
        If the estimator is not fitted, or holds something that such a file may not hold, or the
        path ends otherwise.

    Examples
    --------
    >>> import tempfile
    >>> from sklearn.linear_model import LogisticRegression
    >>> from reliability import load_estimator, save_estimator
    >>> model = LogisticRegression().fit([[0.0], [1.0]], [0, 1])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_estimator(model, f"{folder}/model.skops")
    ...     load_estimator(f"{folder}/model.skops").predict([[2.0]])
    array([1])
    """
    path = as_path(path)
    if path.suffix != SKOPS:
        raise ValueError(f"path must end in {SKOPS}, got {os.fspath(path)!r}.")
    content = model_file(estimator)
    check_model(estimator)
    put(path, content)


def load_estimator(path: str | os.PathLike[str]) -> Any:
    """Load an estimator that :func:`save_estimator` or ``joblib.dump`` saved.

    A ``.skops`` file runs no code: a file that is damaged, or was made to do harm, gives an error.
    Any other file is read with ``joblib.load``, which runs code that the file names, as with any
    pickle: load such files only from those that you trust.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    estimator : object

    Raises
    ------
    ModelFileError
        If the file is truncated, damaged or of another kind, holds no estimator, was saved in
        another format, or needs a class that can't be imported here.
    FileNotFoundError
        If there is no such file.
    """
    path = as_path(path)
    estimator = _load_skops(path) if path.suffix == SKOPS else _load_joblib(path)
    if not hasattr(estimator, "predict"):
        raise ModelFileError(
            f"{path} must hold an estimator, which has the method predict, got "
            f"{type(estimator).__name__}."
        )
    return estimator


def _load_skops(path: Path) -> Any:
    try:
        with needing("torch", f"The network in {path}"):
            estimator = read_model(path)
            check_model(estimator)
    except (ModelFileError, FileNotFoundError, ModuleNotFoundError):
        raise
    except Exception as error:
        raise ModelFileError(
            f"{path} can't be used: {error or repr(error)}. Copy it again, or train and save the "
            "model again."
        ) from error
    return estimator


def _load_joblib(path: Path) -> Any:
    try:
        return joblib.load(path)
    except (ModelFileError, FileNotFoundError):
        raise
    except (ImportError, AttributeError) as error:
        if _is_of_sklearn(error):
            raise ModelFileError(
                f"{path} was saved with another version of scikit-learn than that installed here, "
                f"{sklearn.__version__} ({error}). Install the version that saved it, or train "
                "and save the model again."
            ) from error
        raise ModelFileError(
            f"{path} needs something that can't be imported here ({error}); install it, or move "
            "the class out of the script or notebook that saved the model."
        ) from error
    except Exception as error:
        raise ModelFileError(
            f"{path} is truncated or no joblib file ({error!r}); copy it again, or train and save "
            "the model again."
        ) from error


def _is_of_sklearn(error: ImportError | AttributeError) -> bool:
    """Say whether something is missing that scikit-learn had, or called, by another name."""
    if isinstance(error, AttributeError):
        return "sklearn" in str(error)
    # Up to scikit-learn 1.8, pickles name its compiled losses without their package.
    return error.name == "_loss" or (error.name or "").startswith("sklearn")
