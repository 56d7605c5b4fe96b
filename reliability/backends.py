"""Backends: the kinds of neural network that the classifier can train."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator

from reliability.documentation_link import DocumentationLink
from reliability.networks.hyperparameters import Hyperparameters, as_plain
from reliability.networks.mlp_inference import MLPInference
from reliability.networks.voxel_format import check_pooling, grid_shape
from systems.extras import needing
from systems.validation import check_count, check_flag

if TYPE_CHECKING:
    from reliability.networks.batches import LabelledRows


class Backend(DocumentationLink, BaseEstimator, ABC):
    """A kind of network: its own parameters, and how it is trained unless the user says otherwise.

    Torch is imported when a module is built and not before.

    Attributes
    ----------
    defaults : Hyperparameters
        For those that the classifier leaves at None.
    row_types : list of type
        Types of number that rows may have. Rows of another type are converted to the first.
    fewest_batches : int
        Batches of an epoch at least: fewer rows are gone through several times in each.
    rows_per_forward : int
        Rows that one forward pass takes at most.
    """

    defaults: ClassVar[Hyperparameters]
    row_types: ClassVar[list[Any]] = [np.float32]
    fewest_batches: ClassVar[int] = 1
    rows_per_forward: ClassVar[int] = 8192

    @abstractmethod
    def check(self, n_features: int, packed: bool) -> None:
        """Raise ``ValueError`` if a parameter is out of range or does not fit the rows.

        Parameters
        ----------
        n_features : int
            Columns of X.
        packed : bool
            Whether rows are uint8, which are bit-packed voxel grids.
        """

    @abstractmethod
    def module(self, n_features: int, packed: bool) -> Any:
        """Build a torch module, with random weights, that maps (n, n_features) rows to n logits."""

    def module_for(
        self, training: LabelledRows, weights: dict[str, NDArray[Any]] | None = None
    ) -> Any:
        """Build a module to be trained on rows.

        Parameters
        ----------
        training : LabelledRows
        weights : dict of ndarray, default=None
            What to start from, as :meth:`weights` gives them; None takes random ones.
        """
        module = self.module(training.rows.shape[1], training.rows.dtype == np.uint8)
        if weights is not None:
            self.set_weights(module, weights)
        return module

    def set_weights(self, module: Any, weights: dict[str, NDArray[Any]]) -> None:
        """Give a module the parameters and buffers that :meth:`weights` returned.

        Raises
        ------
        ValueError
            If they are those of another module.
        """
        from reliability.networks.module_inference import as_tensors

        try:
            module.load_state_dict(as_tensors(weights))
        except RuntimeError as error:
            raise ValueError(
                "warm_start needs the backend of the last fit, with the same layers: set "
                f"warm_start=False to begin anew ({error})."
            ) from error

    def weights(self, module: Any) -> dict[str, NDArray[Any]]:
        """Return a trained module's parameters and buffers by name."""
        tensors = module.state_dict().items()
        return {name: tensor.detach().cpu().numpy().copy() for name, tensor in tensors}

    def inference(self, n_features: int, packed: bool, weights: dict[str, NDArray[Any]]) -> Any:
        """Return what computes the logits of a trained module.

        Parameters
        ----------
        n_features, packed
            As given to :meth:`module`.
        weights : dict of ndarray
            As :meth:`weights` gives them.
        """
        with needing("torch", "This network"):
            from reliability.networks.module_inference import ModuleInference

        build = partial(self.module, n_features, packed)
        return ModuleInference(build, weights, self.rows_per_forward)


class MLP(Backend):
    """The paper's network for the arm: fully connected layers with LeakyReLU, and one logit.

    For the training, features are standardized by the median and the spread of the middle half of
    the training rows, so that they may have any unit; the first layer's weights then take this in.

    Parameters
    ----------
    hidden_layer_sizes : tuple of int, default=(256, 128, 64)
        Units of each hidden layer.

    References
    ----------
    McConachie et al. 2020, section V, "Application to a torque-limited planar arm".
    """

    defaults = Hyperparameters(
        max_epochs=25,
        batch_size=256,
        learning_rate=2e-3,
        learning_rate_decay=0.87,
        epochs_per_decay=1,
        validation_fraction=0.2,
        balanced_batches=False,
        patience=5,
    )
    fewest_batches = 10

    def __init__(self, hidden_layer_sizes: tuple[int, ...] = (256, 128, 64)) -> None:
        self.hidden_layer_sizes = hidden_layer_sizes

    def check(self, n_features: int, packed: bool) -> None:
        """Raise ``ValueError`` unless ``hidden_layer_sizes`` holds positive integers."""
        if not isinstance(self.hidden_layer_sizes, tuple | list):
            raise ValueError(
                "hidden_layer_sizes must be a tuple of positive integers, "
                f"got {self.hidden_layer_sizes!r}."
            )
        for size in self.hidden_layer_sizes:
            check_count(size, "Each of hidden_layer_sizes")

    def module(self, n_features: int, packed: bool) -> Any:
        """Build the layers, with random weights."""
        from reliability.networks.mlp_module import MLPModule

        return MLPModule(n_features, as_plain(self.hidden_layer_sizes))

    def module_for(
        self, training: LabelledRows, weights: dict[str, NDArray[Any]] | None = None
    ) -> Any:
        """Build the layers, and standardize what comes in.

        Parameters
        ----------
        training : LabelledRows
        weights : dict of ndarray, default=None
            What to start from, for features that are not standardized; None takes random ones.
        """
        module = super().module_for(training, weights)
        module.standardize(*training.middle_and_scale())
        if weights is not None:
            module.leave_out_scaling()
        return module

    def weights(self, module: Any) -> dict[str, NDArray[Any]]:
        """Return the layers' weights, for features that are not standardized."""
        module.take_in_scaling()
        return super().weights(module)

    def inference(self, n_features: int, packed: bool, weights: dict[str, NDArray[Any]]) -> Any:
        """Return the compiled forward pass, which is fast for a few rows."""
        build = partial(self.module, n_features, packed)
        return MLPInference(build, weights, self.rows_per_forward)


class VoxNet(Backend):
    """The paper's network for the rope: two 3-D convolutions and two full layers.

    Rows of uint8 are voxel grids packed by ``np.packbits``: channels of 16, 32 or 64 cells cubed,
    in the order channel, x, y, z, as ``Rope(features="voxels")`` gives them. Rows of floats, of
    whatever number, are repeated until they fill a grid of one channel.

    Parameters
    ----------
    pooling : {1, 2, 4}, default=1
        Cells are merged into cubes of this many a side before the network sees them: into their
        mean in the first channel, which is the surroundings, and into their maximum in the
        others. 2 makes training and prediction about ten times as fast.
    mixed_precision : bool, default=True
        Compute all layers but the last in bfloat16 on devices with instructions for it. Others
        compute in float32, as they would take ten times as long with bfloat16.
    augment : bool, default=False
        Train on each packed grid rotated about z by a random multiple of 90 degrees and, half of
        the time, mirrored.

    References
    ----------
    McConachie et al. 2020, section VI, "Application to rope manipulation". Maturana and Scherer
    2015, "VoxNet: a 3D convolutional neural network for real-time object recognition".
    """

    defaults = Hyperparameters(
        max_epochs=100,
        batch_size=32,
        learning_rate=5e-4,
        learning_rate_decay=0.8,
        epochs_per_decay=4,
        validation_fraction=0.1,
        balanced_batches=True,
        patience=10,
    )
    row_types: ClassVar[list[Any]] = [np.float32, np.uint8]
    rows_per_forward = 64

    def __init__(
        self, pooling: int = 1, mixed_precision: bool = True, augment: bool = False
    ) -> None:
        self.pooling = pooling
        self.mixed_precision = mixed_precision
        self.augment = augment

    def check(self, n_features: int, packed: bool) -> None:
        """Raise ``ValueError`` if a parameter is out of range or does not fit the grids."""
        check_flag(self.mixed_precision, "mixed_precision")
        check_flag(self.augment, "augment")
        check_pooling(self.pooling)
        if packed:
            check_pooling(self.pooling, grid_shape(n_features)[1])

    def module(self, n_features: int, packed: bool) -> Any:
        """Build the layers, with random weights."""
        from reliability.networks.voxnet_module import VoxNetModule

        grid = grid_shape(n_features) if packed else None
        pooling = int(self.pooling) if packed else 1
        return VoxNetModule(n_features, grid, pooling, self.mixed_precision, self.augment)


class OwnModule(Backend):
    """A network of the user's own.

    Parameters
    ----------
    module_class : type
        A class of torch modules. It is called with the number of features, and must map float32
        rows to one logit each.
    """

    defaults = MLP.defaults

    def __init__(self, module_class: type) -> None:
        self.module_class = module_class

    def check(self, n_features: int, packed: bool) -> None:
        """Accept any rows: the module may have any parameters."""

    def module(self, n_features: int, packed: bool) -> Any:
        """Build the user's module."""
        return self.module_class(n_features=n_features)


_SHORT_FORMS = {"mlp": MLP, "voxnet": VoxNet}


def as_backend(backend: Any) -> Backend:
    """Return the backend that a user names: by an object, a short form or a class of modules.

    Raises
    ------
    ValueError
        If it is none of these.
    """
    if isinstance(backend, Backend):
        return backend
    if isinstance(backend, str) and backend in _SHORT_FORMS:
        return _SHORT_FORMS[backend]()
    if isinstance(backend, type) and not issubclass(backend, Backend):
        return OwnModule(backend)
    raise ValueError(
        'backend must be "mlp", "voxnet", an object such as MLP() or VoxNet(pooling=2), or a class '
        f"of torch modules, got {backend!r}."
    )
