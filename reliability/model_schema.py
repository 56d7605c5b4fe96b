"""What a skops archive says that it holds, checked before anything of it is made.

An archive is a zip file with arrays and ``schema.json``, a tree of nodes. A node names a type and
the loader that makes an object of it. skops checks that the types are trusted. Whoever writes a
file chooses all else in it: loaders that call a type, arguments that compiled constructors believe,
nodes that are referred to a million times, arrays that claim to be larger than memory. So loaders,
the types that each of them may make, their arguments and the amounts are checked here.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from reliability.archive import read_array, read_entry

Node = dict[str, Any]

SCHEMA = "schema.json"
_PROTOCOL = 2
_MOST_BYTES = 64 * 2**20
_MOST_TIMES_PACKED = 50
# Of what JSON consists of, nodes, and levels: a forest has about 400 parts and 75 nodes a tree.
_MOST_PARTS = 4_000_000
_MOST_NODES = 400_000
_MOST_LEVELS = 100
_MOST_CLASSES = 1000

_SCALARS = {
    f"numpy.{name}"
    for name in ["bool", "bool_", "float16", "float32", "float64", "str_"]
    + [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
}
_NUMPY_UFUNCS = {
    f"{module}.{name}"
    for name, thing in vars(np).items()
    if isinstance(thing, np.ufunc)
    for module in ("numpy", "numpy._core._multiarray_umath", "numpy.core._multiarray_umath")
}
_METRICS = {
    f"sklearn.metrics._classification.{name}"
    for name in [
        "accuracy_score",
        "balanced_accuracy_score",
        "brier_score_loss",
        "f1_score",
        "fbeta_score",
        "jaccard_score",
        "log_loss",
        "matthews_corrcoef",
        "precision_score",
        "recall_score",
    ]
}
FUNCTIONS = _METRICS | {
    "sklearn.feature_selection._univariate_selection.f_classif",
    "sklearn.metrics._ranking.average_precision_score",
    "sklearn.metrics._ranking.roc_auc_score",
}
# Modules of scikit-learn whose fitted objects compute with what NumPy checks, or with trees, which
# ``model_checks`` checks. Left out is what computes in C with indices from the file: support vector
# machines, neighbours, encoders that make sparse arrays, and others.
_SKLEARN = (
    "sklearn._loss.",
    "sklearn.calibration.",
    "sklearn.compose.",
    "sklearn.decomposition._pca.",
    "sklearn.discriminant_analysis.",
    "sklearn.dummy.",
    "sklearn.ensemble.",
    "sklearn.feature_selection.",
    "sklearn.frozen.",
    "sklearn.impute._base.",
    "sklearn.isotonic.",
    "sklearn.kernel_approximation.",
    "sklearn.linear_model.",
    "sklearn.metrics._scorer.",
    "sklearn.model_selection.",
    "sklearn.multiclass.",
    "sklearn.naive_bayes.",
    "sklearn.neural_network._multilayer_perceptron.",
    "sklearn.neural_network._stochastic_optimizers.",
    "sklearn.pipeline.",
    "sklearn.preprocessing._data.",
    "sklearn.preprocessing._function_transformer.",
    "sklearn.preprocessing._label.",
    "sklearn.preprocessing._polynomial.",
    "sklearn.tree.",
    "sklearn.utils._bunch.",
    "sklearn.utils._metadata_requests.",
)
OF_THIS_LIBRARY = {
    "reliability.backends.MLP",
    "reliability.backends.VoxNet",
    "reliability.boosting.FastHistGradientBoostingClassifier",
    "reliability.classifier.TransitionReliabilityClassifier",
    "reliability.networks.constant_inference.ConstantInference",
    "reliability.networks.mlp_inference.MLPInference",
    "reliability.networks.module_inference.ModuleInference",
}


def repacked(content: bytes) -> bytes:
    """Check an archive, and return one for skops that holds what it needs and nothing else.

    Two nodes are one object in it only if they are the same array, so that what is made is a tree
    and takes no longer to walk than the file is long.

    Raises
    ------
    ValueError
        If the archive holds what it may not hold.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entries = {entry.filename: entry for entry in archive.infolist()}
        if is_packed_too_well(content):
            raise ValueError(f"it would unpack to more than {_MOST_TIMES_PACKED} times its size")
        schema = _parsed(read_entry(archive, entries[SCHEMA]))
        checked = _CheckedNodes(lambda name: read_entry(archive, entries[name]))
        checked.walk(schema)
    if checked.refused:
        raise ValueError(
            f"it holds {', '.join(sorted(checked.refused))}, which such a file may not hold"
        )
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr(SCHEMA, json.dumps(schema))
        for name, array in checked.arrays.items():
            archive.writestr(name, array)
    return stream.getvalue()


def is_packed_too_well(content: bytes) -> bool:
    """Say whether an archive claims to be larger than any model that was packed to this size."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        n_bytes = sum(entry.file_size for entry in archive.infolist())
    return n_bytes > max(_MOST_BYTES, _MOST_TIMES_PACKED * len(content))


def _parsed(text: bytes) -> Node:
    n_parts = sum(text.count(mark) for mark in (b"{", b"[", b","))
    if n_parts > _MOST_PARTS:
        raise ValueError(f"its schema has {n_parts} parts, more than {_MOST_PARTS}")
    schema = json.loads(text)
    if not isinstance(schema, dict) or schema.get("protocol") != _PROTOCOL:
        raise ValueError("its schema is not of the protocol that this library reads")
    return schema


class _CheckedNodes:
    """Checks the nodes of a schema and gives them new identities, those of the arrays they hold."""

    def __init__(self, read: Callable[[str], bytes]) -> None:
        self.read = read
        self.arrays: dict[str, bytes] = {}
        self.refused: set[str] = set()
        self._ids: dict[str, int] = {}

    def walk(self, root: Node) -> None:
        waiting, n_nodes = [(root, 0)], 0
        while waiting:
            node, level = waiting.pop()
            n_nodes += 1
            if n_nodes > _MOST_NODES or level > _MOST_LEVELS:
                raise ValueError("it holds more objects, or objects within objects, than a model")
            waiting.extend((child, level + 1) for child in self._checked(node))

    def _checked(self, node: Node) -> Iterator[Node]:
        """Check one node, and return those within it."""
        loader, name = node["__loader__"], f"{node['__module__']}.{node['__class__']}"
        node.pop("__id__", None)
        if not _may_make(loader, name):
            self.refused.add(name)
            return iter(())
        if loader in _CHECKS:
            _CHECKS[loader](node, self)
        if loader == "NdArrayNode" and node["type"] == "numpy":
            self.array(node)
            if name == "numpy.ndarray":
                node["__id__"] = self._ids.setdefault(node["file"], len(self._ids) + 1)
            return iter(())
        return _within(node, loader)

    def array(self, node: Node) -> Any:
        """Return the array of a node that names a file."""
        if node["type"] != "numpy":
            raise ValueError("an array is not kept in a file of its own")
        name = node["file"]
        if name not in self.arrays:
            self.arrays[name] = self.read(name)
        return read_array(self.arrays[name], name)


def _may_make(loader: str, name: str) -> bool:
    if loader == "ObjectNode":
        return name in OF_THIS_LIBRARY or name.startswith(_SKLEARN)
    if loader == "LossNode":
        return name.startswith(("sklearn._loss._loss.", "sklearn.linear_model._sgd_fast."))
    return name in _TYPES.get(loader, ())


_TYPES: dict[str, set[str]] = {
    "JsonNode": {"builtins.str"},
    "DictNode": {"builtins.dict", "collections.OrderedDict", "sklearn.utils._bunch.Bunch"},
    "ListNode": {"builtins.list"},
    "TupleNode": {"builtins.tuple"},
    "SetNode": {"builtins.set"},
    "SliceNode": {"builtins.slice"},
    "TypeNode": {"builtins.bool", "builtins.float", "builtins.int", "builtins.str"} | _SCALARS,
    "NdArrayNode": {"numpy.ndarray"} | _SCALARS,
    "MaskedArrayNode": {"numpy.ma.MaskedArray", "numpy.ma.core.MaskedArray"},
    "DTypeNode": {"numpy.dtype"},
    "RandomStateNode": {"numpy.random.mtrand.RandomState"},
    "RandomGeneratorNode": {"numpy.random._generator.Generator"},
    "FunctionNode": FUNCTIONS | _NUMPY_UFUNCS | {"scipy.special._special_ufuncs.expit"},
    "MethodNode": {"reliability.backends.MLP", "reliability.backends.VoxNet"},
    "PartialNode": {"functools.partial"},
    "TreeNode": {"sklearn.tree._tree.Tree"},
}


def _within(node: Node, loader: str) -> Iterator[Node]:
    content = node.get("content")
    if loader in ("JsonNode", "TypeNode", "FunctionNode", "SliceNode"):
        return
    if loader == "MethodNode":
        yield node["content"]["obj"]
        return
    for argument in ("key_types", "shape"):
        if argument in node:
            yield node[argument]
    if "__reduce__" in node:
        yield node["__reduce__"]["args"]
    if loader in ("DictNode", "MaskedArrayNode", "PartialNode", "RandomGeneratorNode"):
        yield from node["content"].values()
    elif isinstance(content, list):
        yield from content
    elif content is not None:
        yield content


def _check_tree(node: Node, nodes: _CheckedNodes) -> None:
    """Check the arguments of a decision tree: its constructor reads as far as they say."""
    n_features, n_classes, n_outputs = node["__reduce__"]["args"]["content"]
    state = node["content"]["content"]
    counts = nodes.array(n_classes)
    sound = (
        counts.dtype.kind == "i"
        and counts.shape == (_json(n_outputs),)
        and ((counts >= 1) & (counts <= _MOST_CLASSES)).all()
        and nodes.array(state["nodes"]).shape == (_json(state["node_count"]),)
    )
    _require(sound and _json(n_features) > 0, "the sizes of a tree do not fit together")


def _json(node: Node) -> Any:
    _require(node["__loader__"] == "JsonNode", "a number is not kept as one")
    return json.loads(node["content"])


def _check_loss(node: Node, nodes: _CheckedNodes) -> None:
    for argument in node["__reduce__"]["args"]["content"]:
        _require(isinstance(_json(argument), int | float), "a loss has an argument of another kind")
    _require(not node["content"]["content"], "a loss has a state")


def _check_generator(node: Node, nodes: _CheckedNodes) -> None:
    pool_size = node["content"]["seed_seq"]["content"]["pool_size"]
    _require(_json(pool_size) == 4, "a random generator's pool_size is not 4")


def _check_method(node: Node, nodes: _CheckedNodes) -> None:
    _require(node["content"]["func"] == "module", "it names a method other than module")
    _require(node["content"]["obj"]["__loader__"] == "ObjectNode", "a method is of no object")


def _check_partial(node: Node, nodes: _CheckedNodes) -> None:
    _require(set(node["content"]) == {"func", "args", "kwds", "namespace"}, "a call is not one")
    _require(node["content"]["func"]["__loader__"] == "MethodNode", "it calls other than a method")
    _require(not node["content"]["kwds"]["content"], "a call has keywords")


_CHECKS: dict[str, Callable[[Node, _CheckedNodes], None]] = {
    "TreeNode": _check_tree,
    "LossNode": _check_loss,
    "RandomGeneratorNode": _check_generator,
    "MethodNode": _check_method,
    "PartialNode": _check_partial,
}


def _require(is_so: Any, otherwise: str) -> None:
    if not is_so:
        raise ValueError(otherwise)
