"""Decision trees, forests and histogram gradient boosting, compiled."""

from __future__ import annotations

from collections.abc import Callable
from operator import is_
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble._hist_gradient_boosting.common import PREDICTOR_RECORD_DTYPE
from sklearn.utils import get_tags

from reliability.fast_inference.compiled_inference import (
    CompiledInference,
    from_decisions,
    from_probabilities,
)
from reliability.fast_inference.tree_kernels import LEAF, NODE, holds_unfit, leaf_sums


class PackedTrees(NamedTuple):
    """The trees of a model as :func:`leaf_sums` reads them."""

    roots: NDArray[np.int64]
    nodes: NDArray[np.void]
    leaf_values: NDArray[np.float64]


class _Fields(NamedTuple):
    """What scikit-learn's arrays of nodes call the fields of ``NODE``."""

    feature: str
    threshold: str
    left: str
    right: str


_FOREST = _Fields("feature", "threshold", "left_child", "right_child")
_BOOSTING = _Fields("feature_idx", "num_threshold", "left", "right")

# A planner compiles its estimator for each plan. A model's packed trees are kept, beside the trees
# that they were made of, for as long as it lives and has the same trees.
_packed: WeakKeyDictionary[Any, tuple[list[Any], PackedTrees]] = WeakKeyDictionary()


def compile_forest(model: Any) -> CompiledInference | None:
    """Compile a fitted decision tree, random forest or forest of extremely randomized trees.

    Returns
    -------
    inference : CompiledInference or None
        None for several outputs.

    Raises
    ------
    ValueError
        If the model is damaged: a node leads nowhere.
    """
    trees = [tree.tree_ for tree in getattr(model, "estimators_", [model])]
    if model.n_outputs_ != 1 or not trees:
        return None
    packed = _kept(model, trees, _packed_forest)
    takes_nan = bool(get_tags(getattr(model, "estimators_", [model])[0]).input_tags.allow_nan)
    n_features, n_trees, name = model.n_features_in_, len(trees), type(model).__name__

    def score(rows: NDArray[Any]) -> NDArray[np.float64]:
        # scikit-learn's trees see values in float32.
        known = _checked(rows, np.float32, n_features, name)
        if holds_unfit(known, takes_nan):
            raise ValueError(
                f"{name} was asked about features that are infinite or too large for float32"
                + ("." if takes_nan else ", or NaN.")
            )
        sums = leaf_sums(known, 0.0, *packed)
        sums /= n_trees
        return sums

    return from_probabilities(score)


def compile_boosting(model: Any) -> CompiledInference | None:
    """Compile a fitted ``HistGradientBoostingClassifier`` of two classes.

    Returns
    -------
    inference : CompiledInference or None
        None for categorical features.

    Raises
    ------
    ValueError
        If the model is damaged: a node leads nowhere.
    """
    trees = [tree.nodes for of_iteration in model._predictors for tree in of_iteration]
    if not trees or getattr(model, "is_categorical_", None) is not None:
        return None
    packed = _kept(model, trees, _packed_boosting)
    n_features, name = model.n_features_in_, type(model).__name__
    baseline = float(model._baseline_prediction.item())

    def score(rows: NDArray[Any]) -> NDArray[np.float64]:
        known = _checked(rows, np.float64, n_features, name)
        sums: NDArray[np.float64] = leaf_sums(known, baseline, *packed)[:, 0]
        return sums

    return from_decisions(score)


def check_tree_nodes(tree: Any, n_features: int, name: str) -> None:
    """Raise unless each node of a ``sklearn.tree`` tree leads on, to one that comes after it.

    Parameters
    ----------
    tree : sklearn.tree._tree.Tree
    n_features : int
        Features that the tree is asked about.
    name : str
        Of the model, for the message.

    Raises
    ------
    ValueError
    """
    nodes = tree.__getstate__()["nodes"]
    _check_nodes([nodes], nodes, nodes["left_child"] == LEAF, n_features, name, _FOREST)


def check_boosting_nodes(trees: list[NDArray[Any]], n_features: int, name: str) -> None:
    """Raise unless each node of histogram gradient boosting leads on, to one that comes after it.

    Parameters
    ----------
    trees : list of structured ndarray
        The nodes of each tree.
    n_features, name
        As in :func:`check_tree_nodes`.

    Raises
    ------
    ValueError
        Also if a node is of a categorical feature.
    """
    if not trees or any(not len(nodes) or nodes.dtype != PREDICTOR_RECORD_DTYPE for nodes in trees):
        raise ValueError(f"{name} is damaged: it has no trees, or they are no trees.")
    together = np.concatenate(trees)
    if together["is_categorical"].any():
        raise ValueError(f"{name} splits by categorical features, which can't be checked.")
    is_leaf = together["is_leaf"].astype(np.bool_)
    _check_nodes(trees, together, is_leaf, n_features, name, _BOOSTING)


def _checked(rows: NDArray[Any], dtype: Any, n_features: int, name: str) -> NDArray[Any]:
    if rows.shape[1] != n_features:
        raise ValueError(f"{name} was fitted on {n_features} features, got {rows.shape[1]}.")
    return np.ascontiguousarray(rows, dtype=dtype)


def _kept(
    model: Any, trees: list[Any], pack: Callable[[Any, list[Any]], PackedTrees]
) -> PackedTrees:
    of, packed = _packed.get(model, ([], None))
    if packed and len(of) == len(trees) and all(map(is_, of, trees)):
        return packed
    packed = pack(model, trees)
    _packed[model] = trees, packed
    return packed


def _packed_forest(model: Any, trees: list[Any]) -> PackedTrees:
    nodes = [tree.__getstate__()["nodes"] for tree in trees]
    values = np.concatenate([tree.value[:, 0, :] for tree in trees])
    together = np.concatenate(nodes)
    return _pack(model, nodes, together, together["left_child"] == LEAF, values, _FOREST)


def _packed_boosting(model: Any, trees: list[Any]) -> PackedTrees:
    together = np.concatenate(trees)
    is_leaf, values = together["is_leaf"].astype(np.bool_), together["value"][:, None]
    return _pack(model, trees, together, is_leaf, values, _BOOSTING)


def _pack(
    model: Any,
    trees: list[NDArray[Any]],
    together: NDArray[Any],
    is_leaf: NDArray[np.bool_],
    values: NDArray[np.float64],
    fields: _Fields,
) -> PackedTrees:
    """Join the nodes of all trees, numbered together, and the values of all leaves."""
    name = type(model).__name__
    children, first = _check_nodes(trees, together, is_leaf, model.n_features_in_, name, fields)
    roots = np.unique(first)
    feature = together[fields.feature]
    nodes = np.empty(len(together), dtype=NODE)
    nodes["threshold"] = together[fields.threshold]
    nodes["feature"] = np.where(is_leaf, LEAF, feature)
    nodes["left"] = np.where(is_leaf, np.cumsum(is_leaf) - 1, children[0] + first)
    nodes["right"] = np.where(is_leaf, LEAF, children[1] + first)
    nodes["missing_goes_left"] = together["missing_go_to_left"]
    return PackedTrees(roots, nodes, np.ascontiguousarray(values[is_leaf]))


def _check_nodes(
    trees: list[NDArray[Any]],
    together: NDArray[Any],
    is_leaf: NDArray[np.bool_],
    n_features: int,
    name: str,
    fields: _Fields,
) -> tuple[list[NDArray[np.int64]], NDArray[np.int64]]:
    """Return each node's two children within its tree, and the number of its tree's first node."""
    sizes = np.array([len(nodes) for nodes in trees])
    roots = np.cumsum(sizes) - sizes
    first, size = np.repeat(roots, sizes), np.repeat(sizes, sizes)
    children = [together[field].astype(np.int64) for field in (fields.left, fields.right)]
    feature = together[fields.feature]
    # A child comes after its parent, so no way through a tree is endless.
    own = np.arange(len(together)) - first
    sound = (feature >= 0) & (feature < n_features)
    for child in children:
        sound &= (child > own) & (child < size)
    if not (sound | is_leaf).all():
        raise ValueError(
            f"{name} is damaged: a node of a tree refers to a node or a feature that does not "
            "exist. Load the model from a sound file, or train it again."
        )
    return children, first
