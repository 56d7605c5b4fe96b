"""The transition reliability classifier, a scikit-learn estimator over a neural network."""

from __future__ import annotations

import os
import warnings
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import expit
from sklearn.base import BaseEstimator, ClassifierMixin, clone
from sklearn.utils.validation import check_is_fitted, validate_data

from reliability.backends import Backend, as_backend
from reliability.base_rate import warn_if_no_better_than_base_rate, weighted_share
from reliability.calibration_curve import CalibrationCurve
from reliability.documentation_link import DocumentationLink
from reliability.fit_callbacks import CallbackSupportMixin, FitTasks
from reliability.model_files import ModelFileError
from reliability.networks.constant_inference import ConstantInference
from reliability.networks.hyperparameters import Hyperparameters
from reliability.networks.voxel_format import check_packed
from reliability.temperature import temperature_factor
from reliability.training_set import (
    check_sample_weight,
    encode_labels,
    hold_out,
    thin,
    weigh_classes,
)
from systems.extras import needing
from systems.validation import RandomState, as_generator, check_flag

if TYPE_CHECKING:
    from reliability.networks.batches import LabelledRows

FORMAT_VERSION = 2
STAMPED_PACKAGES = ("numpy", "scikit-learn", "skorch", "torch")
_ROWS_AT_ONCE = 16384


class TransitionReliabilityClassifier(
    DocumentationLink, CallbackSupportMixin, ClassifierMixin, BaseEstimator
):
    """Predict whether a transition of the reduced model is reliable.

    A neural network that is trained on labelled transitions, with two classes. Part of the plans is
    held out: training stops when the loss on them no longer falls, the weights of the epoch with
    the smallest are kept, and probabilities are calibrated on them. With "mlp", features may have
    any units; with other networks they should be of order one. With few plans and
    features that have corners, boosted trees do better: see docs/classifiers.md.

    Parameters
    ----------
    backend : "mlp", "voxnet", MLP, VoxNet or type, default="mlp"
        The kind of network. ``"mlp"`` is short for ``MLP()``, fully connected layers, and
        ``"voxnet"`` for ``VoxNet()``, convolutions over bit-packed voxel grids. Give an object to
        choose its parameters, as in ``MLP(hidden_layer_sizes=(64, 64))``; ``set_params`` and
        searches then reach them as ``backend__hidden_layer_sizes``. A class of torch modules of
        your own is called with ``n_features``, the number of features, and must map float32 rows
        to one logit each. It must be importable for the fitted classifier to be saved, and is
        trained with the defaults of "mlp".
    max_epochs : int, default=None
        Times that training goes through the rows. Where this and other parameters are None, each
        backend has its own default: here 25 for "mlp" and 100 for "voxnet".
    batch_size : int, default=None
        Rows per step of the optimizer, Adam: 256 for "mlp", 32 for "voxnet".
    learning_rate : float, default=None
        At the start: 2e-3 for "mlp", 5e-4 for "voxnet".
    learning_rate_decay : float, default=None
        Factor by which the learning rate is multiplied every ``epochs_per_decay`` epochs: 0.87 for
        "mlp", 0.8 for "voxnet".
    epochs_per_decay : int, default=None
        1 for "mlp", 4 for "voxnet".
    rows_per_epoch : int, default=None
        Train on so many rows per epoch, drawn at random, and compute the held-out loss of an epoch
        from at most as many. None takes all rows; with "mlp", several times if they are fewer than
        10 batches, as a few steps teach little.
    validation_fraction : float, default=None
        Share of the data that is held out: whole groups if ``fit`` is given groups, else single
        rows. 0.2 for "mlp", 0.1 for "voxnet".
    patience : int or False, default=None
        Stop when the held-out loss of calibrated probabilities has not improved for so many
        epochs, and keep the weights of the epoch with the smallest: 5 for "mlp", 10 for "voxnet".
        False trains for ``max_epochs`` and keeps the last weights, as is done too if nothing is
        held out.
    class_weight : dict, "balanced" or None, default=None
        Weights of the classes in the loss, as in scikit-learn.
    balanced_batches : bool, default=None
        Draw the rows of a batch with replacement so that both classes are equally likely: False
        for "mlp", True for "voxnet".
    device : str, default="cpu"
        Torch device to train and predict on. Prediction uses the CPU where there is no such device.
    checkpoint : path-like, default=None
        File in which the state of the training is kept after each epoch. If ``fit`` was killed,
        call it again with the same data and parameters: it goes on from the file, and ends with
        the same weights as if it had not been killed. Needs a ``random_state``. ``max_epochs`` may
        be larger than before.
    warm_start : bool, default=False
        Start a further ``fit`` from the weights that the last one ended with, instead of random
        ones: to go on learning when more plans have been executed. The learning rate begins anew,
        and ``history_`` is that of the last ``fit``. X must have the same features and y the same
        labels as before, and the backend must be the same. Give the earlier plans along with the
        new ones, as what is no longer shown is forgotten. Rows that are held out now may have been
        trained on before, which makes what is measured on them too good.
    random_state : int, Generator, RandomState or None, default=None
        Makes the split and the training repeatable. Global random generators are neither used nor
        changed.
    verbose : int, default=0
        1 shows a progress bar during ``fit``.

    Attributes
    ----------
    classes_ : ndarray of shape (n_classes,)
        The one or two labels that ``fit`` has seen, sorted.
    n_features_in_ : int
        Columns of X.
    feature_names_in_ : ndarray of str of shape (n_features,)
        Only if X had string column names.
    validation_accuracy_ : float
        Share of the held-out rows, weighted with ``sample_weight``, that are predicted right: the
        paper's p_acc, which planners use. NaN if nothing was held out.
    validation_calibration_error_ : float
        Expected calibration error of the held-out rows' probabilities: by how much, on average,
        the predicted probability of the second class differs from its share among rows of alike
        probability, in ten bins. NaN if nothing was held out.
    history_ : list of dict
        For each epoch ``epoch``, ``train_loss`` and, if rows were held out, ``valid_loss``,
        ``calibrated_valid_loss`` and ``valid_accuracy``.

    Notes
    -----
    From scikit-learn 1.9 on, ``set_callbacks`` takes scikit-learn's callbacks, such as
    ``sklearn.callback.ScoringMonitor``. They are told of ``fit`` and of each epoch, with an
    estimator of the weights so far, not calibrated; one that answers True stops the training.

    After training, all logits are multiplied by one number, from 0.05 to 1, for which the
    probabilities fit the held-out rows best (temperature scaling). Labels do not depend on it.
    The held-out plans thus choose the epoch as well, which makes the attributes measured on them
    a little too good.

    With "voxnet", the last digits of a row's logit may depend on the other rows of its batch, as
    with any tensor library; only a logit of almost zero could change its sign.

    A joblib file holds the weights as arrays, so that it can be read on a machine without the
    device of the training. Loading runs code that the file names, as with any pickle: load only
    files that you trust.

    References
    ----------
    McConachie et al. 2020, section IV, "Learning Transition Reliability". Guo et al. 2017, "On
    calibration of modern neural networks".

    Examples
    --------
    >>> import numpy as np
    >>> from reliability import MLP, TransitionReliabilityClassifier
    >>> X = np.random.default_rng(0).normal(size=(400, 3))
    >>> y = (X[:, 0] > 0).astype(int)
    >>> clf = TransitionReliabilityClassifier(random_state=0).fit(X, y)
    >>> clf.predict([[2.0, 0.0, 0.0], [-2.0, 0.0, 0.0]])
    array([1, 0])
    >>> small = MLP(hidden_layer_sizes=(64, 64))
    >>> clf = TransitionReliabilityClassifier(small, max_epochs=50, random_state=0).fit(X, y)
    >>> clf.predict([[2.0, 0.0, 0.0], [-2.0, 0.0, 0.0]])
    array([1, 0])
    """

    def __init__(
        self,
        backend: str | Backend | type = "mlp",
        *,
        max_epochs: int | None = None,
        batch_size: int | None = None,
        learning_rate: float | None = None,
        learning_rate_decay: float | None = None,
        epochs_per_decay: int | None = None,
        rows_per_epoch: int | None = None,
        validation_fraction: float | None = None,
        patience: int | bool | None = None,
        class_weight: dict[Any, float] | str | None = None,
        balanced_batches: bool | None = None,
        device: str = "cpu",
        checkpoint: str | os.PathLike[str] | None = None,
        warm_start: bool = False,
        random_state: RandomState = None,
        verbose: int = 0,
    ) -> None:
        self.backend = backend
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
        self.device = device
        self.checkpoint = checkpoint
        self.warm_start = warm_start
        self.random_state = random_state
        self.verbose = verbose

    def __sklearn_tags__(self) -> Any:
        """Tell scikit-learn that this is a binary classifier."""
        tags = super().__sklearn_tags__()
        tags.classifier_tags.multi_class = False
        return tags

    def __sklearn_is_fitted__(self) -> bool:
        """Tell scikit-learn whether a training has come to its end."""
        return hasattr(self, "_inference")

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
            Features of transitions. "voxnet" takes uint8 as bit-packed voxel grids.
        y : array-like of shape (n,)
            One or two labels. If there is only one, it is predicted for every row.
        groups : array-like of shape (n,), default=None
            Plan ids. The held-out part is then made of whole plans.
        sample_weight : array-like of shape (n,), default=None
            Weights of the rows in the loss and in the held-out accuracy; None weighs all alike.

        Returns
        -------
        self : TransitionReliabilityClassifier

        Raises
        ------
        ValueError
            If a parameter or the data are out of range, or ``checkpoint`` can't be written.
        ModelFileError
            If ``checkpoint`` is damaged, or a file of another training.
        FloatingPointError
            If the loss or a weight stops being finite.

        Warns
        -----
        BaseRateWarning
            If groups are given, and many of them are held out and predicted no better than by one
            label for all rows.
        """
        # Importing torch takes a second, which making and loading a classifier need not pay.
        with needing("torch", "TransitionReliabilityClassifier.fit"):
            from reliability.networks.batches import LabelledRows

        backend = clone(as_backend(self.backend))
        hyperparameters = backend.defaults.overridden_by(self)
        self._check_checkpoint()
        check_flag(self.warm_start, "warm_start")
        goes_on = self.warm_start and self.__sklearn_is_fitted__()
        rows, labels = validate_data(self, X, y, dtype=backend.row_types, reset=not goes_on)
        classes, target = encode_labels(labels)
        packed = rows.dtype == np.uint8
        if goes_on:
            self._check_same_kind(classes, packed)
        self.classes_, self._packed = classes, packed
        backend.check(self.n_features_in_, self._packed)
        weights = self._weights() if goes_on else None
        weight = check_sample_weight(sample_weight, len(rows))
        loss_weight = weight * weigh_classes(labels, self.classes_, self.class_weight)
        rng = as_generator(self.random_state)
        split = hold_out(len(rows), groups, hyperparameters.validation_fraction, rng)
        data = LabelledRows(rows, target, loss_weight, weight, np.arange(len(rows)))
        training, held_out = map(data.select, split)
        validated = held_out.select(held_out.index[weight[held_out.index] > 0])
        is_second = validated.target[validated.index] == 1
        given = {} if sample_weight is None else {"sample_weight": sample_weight}
        with FitTasks(self, hyperparameters.max_epochs, rows, labels, given) as tasks:
            self._inference, self.history_ = self._train(
                backend, hyperparameters, training, held_out, rng, weights, tasks
            )
            logits = self._logits_of(validated).astype(np.float64)
            self._check_finite(logits)
            factor = temperature_factor(logits, is_second, loss_weight[validated.index])
            self._inference.soften(factor)
        right = (logits > 0) == is_second
        self.validation_accuracy_ = weighted_share(right, weight[validated.index])
        calibration = CalibrationCurve.of(is_second, expit(factor * logits))
        self.validation_calibration_error_ = calibration.expected_error
        if groups is not None:
            plans = np.asarray(groups)[validated.index]
            warn_if_no_better_than_base_rate(
                target[validated.index], right, plans, weight[validated.index]
            )
        self._format_version = FORMAT_VERSION
        self._package_versions = {name: version(name) for name in STAMPED_PACKAGES}
        return self

    def decision_function(self, X: ArrayLike) -> NDArray[np.float32]:
        """Return the logit of the second class, its log-odds, for each row of X.

        Parameters
        ----------
        X : array-like of shape (n, n_features)

        Returns
        -------
        decision : ndarray of float32 of shape (n,)
            Positive where ``classes_[1]`` is predicted.
        """
        check_is_fitted(self)
        if self._packed:
            check_packed(X, self.n_features_in_)
        dtype = np.uint8 if self._packed else np.float32
        rows: NDArray[Any] = validate_data(self, X, dtype=dtype, reset=False)
        return self._inference.logits(rows, self.device)

    @property
    def prefers_batches(self) -> bool:
        """Whether a row costs much less in a batch than alone; known once fitted."""
        return self._inference.prefers_batches

    def fast_decision_function(self, X: NDArray[Any]) -> NDArray[np.float32]:
        """Return :meth:`decision_function` of rows without checking them.

        For planners, which ask a hundred thousand times for a few transitions at a time. With
        "mlp" the sign is always that of :meth:`decision_function`.

        Parameters
        ----------
        X : ndarray of shape (n, n_features)
            Floats, or uint8 where the classifier was fitted on it.

        Returns
        -------
        decision : ndarray of float32 of shape (n,)
        """
        rows = X if self._packed else np.asarray(X, dtype=np.float32)
        return self._inference.fast_logits(rows, self.device)

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

    def check_weights(self) -> None:
        """Raise ``ValueError`` if the trained weights do not fit together, as in a damaged file."""
        check_is_fitted(self)
        self._inference.check(self.n_features_in_)

    def _check_finite(self, logits: NDArray[np.float64]) -> None:
        # The last step of training comes after the last loss.
        try:
            self.check_weights()
        except ValueError as error:
            raise FloatingPointError(f"Training diverged: {error}. Lower learning_rate.") from error
        if not np.isfinite(logits).all():
            raise FloatingPointError("Training diverged: the logits are NaN. Lower learning_rate.")

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Refuse the state of another format."""
        found = state.get("_format_version", FORMAT_VERSION)
        if found != FORMAT_VERSION:
            raise ModelFileError(
                f"This classifier was saved in format {found} with {state['_package_versions']}; "
                f"this version of transition-reliability reads format {FORMAT_VERSION}. Load it "
                "with the version that saved it, or train it again."
            )
        # Files of before this parameter are good as they are.
        super().__setstate__({"warm_start": False, **state})

    def _check_checkpoint(self) -> None:
        if self.checkpoint is None:
            return
        is_path = isinstance(self.checkpoint, str | os.PathLike)
        if not is_path or "\0" in os.fsdecode(self.checkpoint):
            raise ValueError(f"checkpoint must be the path of a file, got {self.checkpoint!r}.")
        if self.random_state is None:
            raise ValueError(
                "checkpoint needs a random_state, as without one a training can't be repeated. "
                "Pass an integer."
            )

    def _weights(self) -> dict[str, NDArray[Any]] | None:
        """Return the weights of the last fit; None if it saw one label only."""
        return getattr(self._inference, "weights", None)

    def _check_same_kind(self, classes: NDArray[Any], packed: bool) -> None:
        """Raise ``ValueError`` unless the data are of the kind that the last ``fit`` had."""
        if not np.array_equal(classes, self.classes_):
            raise ValueError(
                f"warm_start needs the labels of the last fit, {self.classes_.tolist()}, got "
                f"{classes.tolist()}. Give the earlier plans along with the new ones."
            )
        if packed != self._packed:
            raise ValueError(
                "warm_start needs rows as in the last fit: "
                f"{'packed grids of uint8' if self._packed else 'numbers'}, got "
                f"{'packed grids of uint8' if packed else 'numbers'}."
            )

    def _train(
        self,
        backend: Backend,
        hyperparameters: Hyperparameters,
        training: LabelledRows,
        held_out: LabelledRows,
        rng: np.random.Generator,
        weights: dict[str, NDArray[Any]] | None,
        fit_tasks: FitTasks,
    ) -> tuple[Any, list[dict[str, float]]]:
        """Return what computes logits, and the history of the training."""
        training, held_out = training.weighted(), held_out.weighted()
        present = np.unique(training.target[training.index])
        if len(present) == 0:
            raise ValueError("sample_weight must be positive for some training row, got zeros.")
        if len(present) == 1:
            warnings.warn(
                "The training rows are all of one class, which will be predicted for every row.",
                stacklevel=3,
            )
            return ConstantInference(len(self.classes_) > 1 and present[0] == 1), []
        from reliability.networks.training import TrainingTask, train

        task = TrainingTask(
            backend,
            training,
            held_out.select(thin(held_out.index, hyperparameters.rows_per_epoch)),
            hyperparameters,
            seed=int(rng.integers(2**31)),
            device=self.device,
            checkpoint=self.checkpoint,
            verbose=self.verbose,
            weights=weights,
            fit_tasks=fit_tasks,
        )
        trained, history = train(task)
        return backend.inference(self.n_features_in_, self._packed, trained), history

    def _logits_of(self, data: LabelledRows) -> NDArray[np.float32]:
        """Return the logit of each row, shape (n,)."""
        logits = np.empty(len(data), dtype=np.float32)
        # Some at a time, as X may be a file larger than memory.
        for begin in range(0, len(data), _ROWS_AT_ONCE):
            part = data.index[begin : begin + _ROWS_AT_ONCE]
            logits[begin : begin + _ROWS_AT_ONCE] = self._inference.logits(
                data.rows[part], self.device
            )
        return logits
