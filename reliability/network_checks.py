"""Whether a trained network that was read from a file is one that the classifier trains."""

from __future__ import annotations

from typing import Any

from reliability.backends import MLP, Backend, VoxNet
from reliability.classifier import TransitionReliabilityClassifier
from reliability.networks.constant_inference import ConstantInference
from reliability.networks.hyperparameters import as_plain
from reliability.networks.mlp_inference import MLPInference


def check_network(classifier: TransitionReliabilityClassifier) -> None:
    """Raise unless what computes logits builds the network that its weights are of.

    The network is built from a call that the file holds, of a size that the file chooses.

    Parameters
    ----------
    classifier : TransitionReliabilityClassifier
        Fitted.

    Raises
    ------
    ValueError
    """
    inference = classifier._inference
    if not isinstance(classifier.device, str):
        raise ValueError(f"device is {classifier.device!r}")
    if type(inference) is not ConstantInference:
        backend = _backend_of(classifier)
        if isinstance(backend, MLP):
            _check_layers(inference, backend)
    classifier.check_weights()


def _backend_of(classifier: TransitionReliabilityClassifier) -> Backend:
    inference, packed = classifier._inference, classifier._packed
    n_features = classifier.n_features_in_
    build: Any = inference.build
    function = getattr(build, "func", None)
    backend: Any = getattr(function, "__self__", None)
    kind: Any = type(backend)
    is_built_here = (
        kind in (MLP, VoxNet)
        and getattr(function, "__func__", None) is kind.module
        and build.args == (n_features, packed)
        and not build.keywords
        and inference.rows_per_forward == kind.rows_per_forward
        and type(inference) is _inference_class(kind)
    )
    if not is_built_here:
        raise ValueError("the weights are of a network that is not one of this library's")
    backend.check(n_features, packed)
    known: Backend = backend
    return known


def _inference_class(kind: type[Backend]) -> type:
    if kind is MLP:
        return MLPInference
    from reliability.networks.module_inference import ModuleInference

    return ModuleInference


def _check_layers(inference: MLPInference, backend: MLP) -> None:
    sizes = [*as_plain(backend.hidden_layer_sizes), 1]
    names = [f"layers.{2 * i}.{kind}" for i in range(len(sizes)) for kind in ("weight", "bias")]
    biases = list(inference.weights.values())[1::2]
    if list(inference.weights) != names or [len(bias) for bias in biases] != sizes:
        raise ValueError("the weights do not fit hidden_layer_sizes")
