"""The torch module of the multilayer perceptron."""

from __future__ import annotations

import itertools

from torch import Tensor, nn


class MLPModule(nn.Module):
    """LeakyReLU layers and one logit.

    Parameters
    ----------
    n_features : int
    hidden_layer_sizes : tuple of int
    """

    def __init__(self, n_features: int, hidden_layer_sizes: tuple[int, ...]) -> None:
        super().__init__()
        sizes = [n_features, *hidden_layer_sizes]
        layers: list[nn.Module] = []
        for n_inputs, n_outputs in itertools.pairwise(sizes):
            layers += [nn.Linear(n_inputs, n_outputs), nn.LeakyReLU()]
        self.layers = nn.Sequential(*layers, nn.Linear(sizes[-1], 1))

    def forward(self, rows: Tensor) -> Tensor:
        """Map (n, n_features) rows to (n, 1) logits."""
        return self.layers(rows)
