"""The torch module of the multilayer perceptron."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn


class MLPModule(nn.Module):
    """LeakyReLU layers and one logit.

    Parameters
    ----------
    n_features : int
    hidden_layer_sizes : tuple of int
    """

    middle: Tensor
    scale: Tensor

    def __init__(self, n_features: int, hidden_layer_sizes: tuple[int, ...]) -> None:
        super().__init__()
        sizes = [n_features, *hidden_layer_sizes]
        layers: list[nn.Module] = []
        for n_inputs, n_outputs in itertools.pairwise(sizes):
            layers += [nn.Linear(n_inputs, n_outputs), nn.LeakyReLU()]
        self.layers = nn.Sequential(*layers, nn.Linear(sizes[-1], 1))
        # Not persistent: the weights of a trained module have taken them in.
        self.register_buffer("middle", torch.zeros(n_features), persistent=False)
        self.register_buffer("scale", torch.ones(n_features), persistent=False)

    def forward(self, rows: Tensor) -> Tensor:
        """Map (n, n_features) rows to (n, 1) logits."""
        return self.layers((rows - self.middle) / self.scale)

    def standardize(self, middle: NDArray[np.float64], scale: NDArray[np.float64]) -> None:
        """Subtract a middle from each feature and divide it by a scale, before the first layer.

        Parameters
        ----------
        middle, scale : ndarray of shape (n_features,)
        """
        self.middle.copy_(torch.from_numpy(middle))
        self.scale.copy_(torch.from_numpy(scale))

    @torch.no_grad()
    def take_in_scaling(self) -> None:
        """Let the first layer give for features what it gave for standardized ones."""
        first: Any = self.layers[0]
        weight = first.weight.double() / self.scale.double()
        first.bias.copy_(first.bias.double() - weight @ self.middle.double())
        first.weight.copy_(weight)
        self.middle.zero_()
        self.scale.fill_(1)

    @torch.no_grad()
    def leave_out_scaling(self) -> None:
        """Let the first layer give for standardized features what it gave for others."""
        first: Any = self.layers[0]
        weight = first.weight.double()
        first.bias.copy_(first.bias.double() + weight @ self.middle.double())
        first.weight.copy_(weight * self.scale.double())
