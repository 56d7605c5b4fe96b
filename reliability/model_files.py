"""Model files that run no code: skops archives with a digest of their own."""

from __future__ import annotations

import hashlib
import io
import warnings
import zipfile
from pathlib import Path
from typing import Any

from reliability.model_schema import FUNCTIONS, OF_THIS_LIBRARY, is_packed_too_well, repacked

# An archive's comment: this, and a digest of all bytes before the comment.
_MAGIC = b"transition-reliability model, blake2b "
_DIGEST_SIZE = 20
_COMMENT_SIZE = len(_MAGIC) + 2 * _DIGEST_SIZE
# What skops itself does not trust: it can tell types apart, and not whether their content is sound.
_TRUSTED = sorted(
    OF_THIS_LIBRARY
    | FUNCTIONS
    | {
        "functools.partial",
        "numpy.dtype",
        "reliability.backends.MLP.module",
        "reliability.backends.VoxNet.module",
        "sklearn.calibration._CalibratedClassifier",
        "sklearn.calibration._SigmoidCalibration",
        "sklearn.calibration._TemperatureScaling",
        "sklearn.ensemble._hist_gradient_boosting.predictor.TreePredictor",
        "sklearn.metrics._scorer._CurveScorer",
        "sklearn.metrics._scorer._PassthroughScorer",
        "sklearn.metrics._scorer._Scorer",
        "sklearn.model_selection._split.GroupKFold",
        "sklearn.model_selection._split.KFold",
        "sklearn.model_selection._split.StratifiedGroupKFold",
        "sklearn.model_selection._split.StratifiedKFold",
        "sklearn.neural_network._stochastic_optimizers.AdamOptimizer",
        "sklearn.neural_network._stochastic_optimizers.SGDOptimizer",
        "sklearn.tree._tree.Tree",
        "sklearn.utils._bunch.Bunch",
        "sklearn.utils._metadata_requests.MetadataRequest",
        "sklearn.utils._metadata_requests.MethodMetadataRequest",
    }
)


class ModelFileError(ValueError):
    """A model file can't be used; the message says why and what to do."""


def model_file(model: Any) -> bytes:
    """Return the content of a model's file.

    Raises
    ------
    ValueError
        If the model holds something that :func:`read_model` would refuse.
    """
    try:
        content = _packed(model)
        _check_types(repacked(content))
    except Exception as error:
        raise ValueError(
            f"estimator, a {type(model).__name__}, can't be saved to a .skops file: "
            f"{error or repr(error)}. Save it with joblib.dump."
        ) from error
    return sealed(content)


def read_model(path: Path) -> Any:
    """Read a file that :func:`model_file` made, without running code that it names.

    Raises
    ------
    ValueError
        If the file is damaged, is another kind of file, or holds a type that is not trusted.
    FileNotFoundError
        If there is no such file.
    """
    import skops.io

    content = path.read_bytes()
    _check_seal(content)
    content = repacked(content)
    _check_types(content)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Versions differ: models are checked after loading.
        return skops.io.loads(content, trusted=_TRUSTED)


def sealed(content: bytes) -> bytes:
    """Return an archive with a comment that holds a digest of all that precedes the comment."""
    stream = io.BytesIO(content)
    with zipfile.ZipFile(stream, "a") as archive:
        archive.comment = bytes(_COMMENT_SIZE)
    body = stream.getvalue()[:-_COMMENT_SIZE]
    return body + _comment_for(body)


def _check_seal(content: bytes) -> None:
    body, comment = content[:-_COMMENT_SIZE], content[-_COMMENT_SIZE:]
    if not comment.startswith(_MAGIC):
        raise ValueError("it is truncated, or not a file that save_estimator wrote")
    if comment != _comment_for(body):
        raise ValueError("it was changed after it had been written: its digest is another")


def _comment_for(body: bytes) -> bytes:
    return _MAGIC + hashlib.blake2b(body, digest_size=_DIGEST_SIZE).hexdigest().encode()


def _packed(model: Any) -> bytes:
    import skops.io

    packed: bytes = skops.io.dumps(model, compression=zipfile.ZIP_DEFLATED, compresslevel=9)
    if is_packed_too_well(packed):
        packed = skops.io.dumps(model)
    return packed


def _check_types(content: bytes) -> None:
    import skops.io

    unknown = set(skops.io.get_untrusted_types(data=content)) - set(_TRUSTED)
    if unknown:
        raise ValueError(f"it holds {', '.join(sorted(unknown))}, which such a file may not hold")
