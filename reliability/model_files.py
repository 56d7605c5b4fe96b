"""Model files that run no code: skops archives with a digest of their own."""

from __future__ import annotations

import hashlib
import io
import json
import warnings
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from reliability.item_files import put

# An archive's comment: this, and a digest of all bytes before the comment.
_MAGIC = b"transition-reliability model, blake2b "
_DIGEST_SIZE = 20
_COMMENT_SIZE = len(_MAGIC) + 2 * _DIGEST_SIZE
# Nothing larger is unpacked.
_MOST_BYTES = 4 * 2**30
_SCHEMA = "schema.json"

# Everything else is refused. Of scikit-learn, that leaves out what computes in C on indices that
# nothing checks: support vector machines and trees of neighbours.
_OF_THIS_LIBRARY = {
    "reliability.backends.MLP",
    "reliability.backends.MLP.module",
    "reliability.backends.VoxNet",
    "reliability.backends.VoxNet.module",
    "reliability.boosting.FastHistGradientBoostingClassifier",
    "reliability.classifier.TransitionReliabilityClassifier",
    "reliability.networks.constant_inference.ConstantInference",
    "reliability.networks.mlp_inference.MLPInference",
    "reliability.networks.module_inference.ModuleInference",
    "functools.partial",
}
_OF_SKLEARN = {
    "sklearn.calibration._CalibratedClassifier",
    "sklearn.calibration._SigmoidCalibration",
    "sklearn.calibration._TemperatureScaling",
    "sklearn.ensemble._hist_gradient_boosting.predictor.TreePredictor",
    "sklearn.metrics._scorer._PassthroughScorer",
    "sklearn.model_selection._split.GroupKFold",
    "sklearn.model_selection._split.KFold",
    "sklearn.model_selection._split.StratifiedGroupKFold",
    "sklearn.model_selection._split.StratifiedKFold",
    "sklearn.neural_network._stochastic_optimizers.AdamOptimizer",
    "sklearn.neural_network._stochastic_optimizers.SGDOptimizer",
    "sklearn.tree._tree.Tree",
    "sklearn.utils._bunch.Bunch",
}
_REFUSED = ("sklearn.svm", "sklearn.neighbors", "sklearn.cluster", "sklearn.manifold")
_TRUSTED = sorted(_OF_THIS_LIBRARY | _OF_SKLEARN)


class ModelFileError(ValueError):
    """A model file can't be used; the message says why and what to do."""


def write_model(path: Path, model: Any) -> None:
    """Write a model; whatever stood there is replaced only when all is written.

    Raises
    ------
    ValueError
        If the model holds something that :func:`read_model` would refuse.
    """
    import skops.io

    try:
        content = skops.io.dumps(model, compression=zipfile.ZIP_DEFLATED, compresslevel=9)
    except Exception as error:
        raise ValueError(
            f"{type(model).__name__} can't be saved to a .skops file ({error}); save it with "
            "joblib.dump."
        ) from error
    refused = _refused_types(content)
    if refused:
        raise ValueError(
            f"{type(model).__name__} can't be saved to a .skops file, since it holds "
            f"{', '.join(refused)}, which is not among the types that such a file may hold; save "
            "it with joblib.dump."
        )
    put(path, memoryview(sealed(content)))


def read_model(path: Path) -> Any:
    """Read a model that :func:`write_model` wrote, without running code that the file names.

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
    refused = _refused_types(content)
    if refused:
        raise ValueError(f"it holds {', '.join(refused)}, which such a file may not hold")
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
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        if sum(entry.file_size for entry in archive.infolist()) > _MOST_BYTES:
            raise ValueError(f"its content is larger than {_MOST_BYTES} bytes")


def _comment_for(body: bytes) -> bytes:
    return _MAGIC + hashlib.blake2b(body, digest_size=_DIGEST_SIZE).hexdigest().encode()


def _refused_types(content: bytes) -> list[str]:
    """Return the names of types in an archive that may not be loaded, sorted."""
    import skops.io

    unknown = set(skops.io.get_untrusted_types(data=content)) - set(_TRUSTED)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        schema = json.loads(archive.read(_SCHEMA))
    native = {name for name in _named_types(schema) if name.startswith(_REFUSED)}
    return sorted(unknown | native)


def _named_types(node: Any) -> Iterator[str]:
    waiting = [node]
    while waiting:
        node = waiting.pop()
        if isinstance(node, dict):
            yield f"{node.get('__module__')}.{node.get('__class__')}"
            waiting.extend(node.values())
        elif isinstance(node, list):
            waiting.extend(node)
