"""The transition reliability classifier, a scikit-learn estimator over a neural network."""

from __future__ import annotations

import os
import warnings
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import expit
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils.metaestimators import available_if
from sklearn.utils.validation import check_is_fitted, validate_data

from reliability.backends import (
    accuracy,
    check_packed,
    check_parameters,
    check_pooling,
    resolved,
    row_types,
)
from reliability.mlp_kernel import mlp_logits
from reliability.persistence import ModelFileError
from reliability.training_set import encode_labels, hold_out, weigh_rows
from systems.validation import RandomState, as_generator

FORMAT_VERSION = 1
LEAKY_SLOPE = np.float32(0.01)
# Below this many rows, importing a tensor library costs more than it saves.
ROWS_FOR_TORCH = 2048
# What rounding can do to a logit, generously, per unit of the row's largest feature.
LOGIT_ROUNDING = np.float32(1e-4)
CERTAIN_LOGIT = 30.0
STAMPED_PACKAGES = ("numpy", "scikit-learn", "skorch", "torch")


def _is_mlp(estimator: TransitionReliabilityClassifier) -> bool:
    return estimator.backend == "mlp"


def _answers_unchecked(estimator: TransitionReliabilityClassifier) -> bool:
    return estimator.backend in ("mlp", "voxnet")


class TransitionReliabilityClassifier(ClassifierMixin, BaseEstimator):
    """Predict whether a transition of the reduced model is reliable.

    A binary neural network classifier. Features should be of order one.

    Parameters
    ----------
    backend : {"mlp", "voxnet"} or type, default="mlp"
        "mlp" is the paper's network for the arm: LeakyReLU layers and one logit. "voxnet" is its
        network for the rope: two three-dimensional convolutions and two full layers over rows of
        uint8, which are voxel grids packed by ``np.packbits`` (channels of 16, 32 or 64 cells
        cubed, in the order channel, x, y, z); floats of any number fill a grid of their own. A
        class of torch modules of your own is called with the number of features, and must map
        float32 rows to one logit each; it must be importable for the fitted classifier to be
        saved.
    hidden_layer_sizes : tuple of int, default=(256, 128, 64)
        Units of the "mlp" backend.
    max_epochs : int, default=None
        This and the other defaults of None are the backend's own: 25, or 100 for "voxnet".
    batch_size : int, default=None
        256, or 32 for "voxnet".
    learning_rate : float, default=None
        Initial learning rate of Adam: 2e-3, or 5e-4 for "voxnet".
    learning_rate_decay : float, default=None
        Factor by which the learning rate is multiplied every ``epochs_per_decay`` epochs: 0.87,
        or 0.8 for "voxnet".
    epochs_per_decay : int, default=None
        1, or 4 for "voxnet".
    rows_per_epoch : int, default=None
        Rows that an epoch draws. None takes as many as there are. Where it is given, the
        held-out loss of an epoch is that of as many rows at most.
    validation_fraction : float, default=None
        Share of the data that is held out: whole groups if ``fit`` is given groups, single rows
        if not. 0.2, or 0.1 for "voxnet".
    patience : int, default=None
        Stop when the held-out loss has not improved for so many epochs, and keep the best epoch's
        weights. None trains for ``max_epochs``.
    class_weight : dict, "balanced" or None, default=None
        Weights of the classes in the loss, as in scikit-learn.
    balanced_batches : bool, default=None
        Draw training batches with replacement so that both classes are equally likely: False, or
        True for "voxnet".
    pooling : {1, 2, 4}, default=1
        "voxnet" sees cubes of so many cells a side as one: the mean of the first channel, which
        is the surroundings, and the maximum of the others. 2 makes it ten times as fast.
    mixed_precision : bool, default=True
        "voxnet" computes in bfloat16, all but its last layer, where the device has instructions
        for it: CPUs that have none take ten times as long as with float32.
    augment : bool, default=False
        "voxnet" learns each packed grid turned about z by a multiple of 90 degrees and mirrored
        at random.
    device : str, default="cpu"
        Torch device to train and predict on. A model whose device is not here predicts on the
        CPU.
    checkpoint : path-like, default=None
        File in which the training is kept after each epoch. A fit that was killed goes on from
        it when it is called again with the same data and parameters, ``random_state`` among
        them, and ends with the same weights; ``max_epochs`` may have grown.
    random_state : int, Generator, RandomState or None, default=None
        Reproduces the split and the training; global generators are left alone.
    verbose : int, default=0
        1 shows a progress bar during ``fit``.

    Attributes
    ----------
    classes_ : ndarray of shape (n_classes,)
    n_features_in_ : int
    feature_names_in_ : ndarray of str
        Only if X had string column names.
    validation_accuracy_ : float
        Accuracy on the held-out part: the planner's p_acc. NaN if nothing was held out.
    history_ : list of dict
        Per epoch: ``train_loss``, ``valid_loss``, ``valid_accuracy``.

    Notes
    -----
    With "voxnet" the last digits of a row's logit may depend on the other rows of its batch, as
    with any tensor library; only a logit of almost zero could change its sign.

    A joblib file holds the weights as arrays and no training state, so that it loads on a machine
    without the training device. Like any pickle, load only files that you trust.

    References
    ----------
    McConachie et al. 2020, "Learning Transition Reliability".

    Examples
    --------
    >>> import numpy as np
    >>> from reliability import TransitionReliabilityClassifier
    >>> X = np.random.default_rng(0).normal(size=(400, 3))
    >>> y = (X[:, 0] > 0).astype(int)
    >>> clf = TransitionReliabilityClassifier(random_state=0).fit(X, y)
    >>> clf.predict([[2.0, 0.0, 0.0], [-2.0, 0.0, 0.0]])
    array([1, 0])
    """

    def __init__(
        self,
        backend: str | type = "mlp",
        *,
        hidden_layer_sizes: tuple[int, ...] = (256, 128, 64),
        max_epochs: int | None = None,
        batch_size: int | None = None,
        learning_rate: float | None = None,
        learning_rate_decay: float | None = None,
        epochs_per_decay: int | None = None,
        rows_per_epoch: int | None = None,
        validation_fraction: float | None = None,
        patience: int | None = None,
        class_weight: dict[Any, float] | str | None = None,
        balanced_batches: bool | None = None,
        pooling: int = 1,
        mixed_precision: bool = True,
        augment: bool = False,
        device: str = "cpu",
        checkpoint: str | os.PathLike[str] | None = None,
        random_state: RandomState = None,
        verbose: int = 0,
    ) -> None:
        self.backend = backend
        self.hidden_layer_sizes = hidden_layer_sizes
        self.max_epochs = max_epochs
        self.batch_size = batch_size
        self.learning_rate = learning_rate
        self.learning_rate_decay = learning_rate_decay
        self.epochs_per_decay = epochs_per_decay
        self.rows_per_epoch = rows_per_epoch
        self.validation_fraction = validation_fraction
        self.patience = patience
        self.class_weight = class_weight
        self.balanced_batches = balanced_batches
        self.pooling = pooling
        self.mixed_precision = mixed_precision
        self.augment = augment
        self.device = device
        self.checkpoint = checkpoint
        self.random_state = random_state
        self.verbose = verbose

    def __sklearn_tags__(self) -> Any:
        """Tell scikit-learn that this is a binary classifier."""
        tags = super().__sklearn_tags__()
        tags.classifier_tags.multi_class = False
        return tags

    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        groups: ArrayLike | None = None,
        sample_weight: ArrayLike | None = None,
    ) -> TransitionReliabilityClassifier:
        """Train on labelled transitions.

        Parameters
        ----------
        X : array-like of shape (n, n_features)
        y : array-like of shape (n,)
            One or two labels; with one, that label is predicted ever after.
        groups : array-like of shape (n,), default=None
            Plan ids. The held-out part is then made of whole plans.
        sample_weight : array-like of shape (n,), default=None

        Returns
        -------
        self : TransitionReliabilityClassifier

        Raises
        ------
        ValueError
            If a parameter or the data are unfit.
            Or if ``checkpoint`` is a file of another training.
        FloatingPointError
            If training diverges.
        """
        parameters = resolved(self)
        check_parameters(parameters)
        rows, labels = validate_data(self, X, y, dtype=row_types(self))
        self._packed = rows.dtype == np.uint8
        if self._packed:
            check_pooling(self.n_features_in_, self.pooling)
        self.classes_, target = encode_labels(labels)
        weight = weigh_rows(labels, self.classes_, self.class_weight, sample_weight)
        rng = as_generator(self.random_state)
        fraction = parameters["validation_fraction"]
        training, held_out = hold_out(len(rows), groups, fraction, rng)
        used = training[weight[training] > 0]
        if len(used) == 0:
            raise ValueError("sample_weight must be positive for some training row, got zeros.")
        self.history_: list[dict[str, float]] = []
        self._state: dict[str, NDArray[np.float32]] = {}
        self._forget_module()
        self._constant = _constant_logit(target[used], len(self.classes_))
        if self._constant is None:
            data = (rows, target, weight)
            self._train(parameters, data, used, held_out, int(rng.integers(2**31)))
        else:
            warnings.warn(
                "The training rows are all of one class, which will always be predicted.",
                stacklevel=2,
            )
        self._format_version = FORMAT_VERSION
        self._package_versions = {name: version(name) for name in STAMPED_PACKAGES}
        self.validation_accuracy_ = accuracy(self, rows, self.classes_[target], held_out)
        return self

    def decision_function(self, X: ArrayLike) -> NDArray[np.float32]:
        """Return the logit of the second class for each row of X.

        Parameters
        ----------
        X : array-like of shape (n, n_features)

        Returns
        -------
        decision : ndarray of shape (n,)
            Positive where ``classes_[1]`` is predicted.
        """
        check_is_fitted(self)
        if self._packed:
            check_packed(X, self.n_features_in_)
        types = np.uint8 if self._packed else np.float32
        rows: NDArray[Any] = validate_data(self, X, dtype=types, reset=False)
        if self._constant is not None:
            return np.full(len(rows), self._constant, dtype=np.float32)
        if not _is_mlp(self):
            return self._torch_logits(rows)
        if len(rows) < ROWS_FOR_TORCH:
            return self._kernel_logits(rows)
        decision = self._torch_logits(rows)
        # Rounding must not decide: near the boundary planners and predict ask the same kernel.
        largest = 1 + np.abs(rows).max(axis=1)
        doubtful = np.abs(decision) < LOGIT_ROUNDING * largest
        decision[doubtful] = self._kernel_logits(rows[doubtful])
        return decision

    @property
    def prefers_batches(self) -> bool:
        """Whether a row costs much less in a batch than alone."""
        return not _is_mlp(self)

    @available_if(_answers_unchecked)
    def fast_decision_function(self, X: NDArray[Any]) -> NDArray[np.float32]:
        """Return :meth:`decision_function` of rows that are known to be sound.

        For planners, which ask for a few transitions at a time and a hundred thousand times:
        nothing is validated. With "mlp" the sign is always that of :meth:`decision_function`.

        Parameters
        ----------
        X : ndarray of shape (n, n_features)
            Floats, or uint8 where the classifier was fitted on it.
        """
        if self._constant is not None:
            return np.full(len(X), self._constant, dtype=np.float32)
        if _is_mlp(self):
            return self._kernel_logits(X)
        return self._torch_logits(X if self._packed else np.asarray(X, dtype=np.float32))

    def predict_proba(self, X: ArrayLike) -> NDArray[np.float64]:
        """Return the probability of each class for each row of X.

        Parameters
        ----------
        X : array-like of shape (n, n_features)

        Returns
        -------
        probabilities : ndarray of shape (n, n_classes)
            Columns as in ``classes_``.
        """
        decision = self.decision_function(X).astype(np.float64)
        if len(self.classes_) == 1:
            return np.ones((len(decision), 1))
        second = expit(decision)
        return np.column_stack([1 - second, second])

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """Return the more likely label for each row of X.

        Parameters
        ----------
        X : array-like of shape (n, n_features)

        Returns
        -------
        y : ndarray of shape (n,)
        """
        decision = self.decision_function(X)
        return self.classes_[(decision > 0).astype(np.intp)]

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what is rebuilt from the weights."""
        state = dict(super().__getstate__())
        state.pop("_module", None)
        state.pop("_flat", None)
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Refuse the state of another format."""
        found = state.get("_format_version", FORMAT_VERSION)
        if found != FORMAT_VERSION:
            raise ModelFileError(
                f"This classifier was saved in format {found} with {state['_package_versions']}; "
                f"this version of transition-reliability reads format {FORMAT_VERSION}. Load it "
                "with the version that saved it, or train it again."
            )
        super().__setstate__(state)

    def _train(
        self,
        parameters: dict[str, Any],
        data: tuple[NDArray[Any], NDArray[np.intp], NDArray[np.float64]],
        training: NDArray[np.intp],
        held_out: NDArray[np.intp],
        seed: int,
    ) -> None:
        from reliability import networks

        kept = {name: parameters[name] for name in networks.PLAN_PARAMETERS}
        kept["patience"] = self.patience if len(held_out) else None
        provenance = {}
        if self.checkpoint is not None:
            provenance = networks.provenance(parameters, data, training, held_out, seed)
        judged = held_out[:: -(-len(held_out) // (self.rows_per_epoch or len(held_out) or 1)) or 1]
        self._state, self.history_ = networks.train(
            *self._architecture(),
            networks.TrainingData(*data, training),
            networks.TrainingData(*data, judged) if len(judged) else None,
            networks.TrainingPlan(**kept, provenance=provenance),
            seed,
        )

    def _architecture(self) -> tuple[Any, dict[str, Any]]:
        size = {"n_features": self.n_features_in_}
        if _is_mlp(self):
            from reliability.networks import MLP

            return MLP, size | {"hidden_layer_sizes": tuple(self.hidden_layer_sizes)}
        if self.backend == "voxnet":
            from reliability.voxnet import VoxNet

            names = ("pooling", "mixed_precision", "augment")
            own = {name: getattr(self, name) for name in names}
            return VoxNet, size | {"packed": self._packed} | own
        return self.backend, size

    def _torch_logits(self, X: NDArray[Any]) -> NDArray[np.float32]:
        from reliability import networks

        if not hasattr(self, "_module"):
            module = networks.restore(*self._architecture(), self._state, self.device)
            self._module = module
        with networks.one_thread():
            return networks.logits(self._module, X)

    def _kernel_logits(self, X: NDArray[Any]) -> NDArray[np.float32]:
        if not hasattr(self, "_flat"):
            self._flat = _flattened(list(self._state.values()))
        rows = np.array(X, dtype=np.float32, order="C")
        return mlp_logits(rows, *self._flat, LEAKY_SLOPE)

    def _forget_module(self) -> None:
        self.__dict__.pop("_module", None)
        self.__dict__.pop("_flat", None)


def _constant_logit(target: NDArray[np.intp], n_classes: int) -> float | None:
    present = np.unique(target)
    if len(present) > 1:
        return None
    return CERTAIN_LOGIT if n_classes > 1 and present[0] == 1 else -CERTAIN_LOGIT


def _flattened(
    arrays: list[NDArray[np.float32]],
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Lay out weights and biases, as torch orders them, for the compiled forward pass."""
    weights, biases = arrays[0::2], arrays[1::2]
    sizes = np.array([weights[0].shape[1], *(len(bias) for bias in biases)])
    layers = zip(weights, biases, strict=True)
    return sizes, np.concatenate([part.ravel() for w, b in layers for part in (w.T, b)])
