"""Torch modules whose answers show how they were trained."""

import pytest

torch = pytest.importorskip("torch", reason="needs the extra [torch]")


class Own(torch.nn.Module):
    """A base with one parameter, which optimizers want, and which has no influence."""

    def __init__(self, n_features):
        super().__init__()
        self.idle = torch.nn.Parameter(torch.zeros(1))


class Echo(Own):
    """Answers with the first feature, so that every loss and accuracy follows from the data."""

    def forward(self, rows):
        return rows[:, :1] + 0 * self.idle


class Visits(Own):
    """Answers how often it was trained on a row, whose number is the first feature.

    Row -1 stands for the number of batches.
    """

    def __init__(self, n_features):
        super().__init__(n_features)
        self.register_buffer("visits", torch.zeros(1001))

    def forward(self, rows):
        numbers = rows[:, 0].long()
        if self.training:
            self.visits.index_add_(0, numbers, torch.ones(len(rows)))
            self.visits[-1] += 1
        return self.visits[numbers, None] + 0 * self.idle


class Scripted(Own):
    """Multiplies the first feature by a number of its script, one after another per batch."""

    script = (0.1, 0.5, 0.3, 0.4, 0.2, 0.45, 0.9, 0.1)

    def __init__(self, n_features):
        super().__init__(n_features)
        self.register_buffer("batch", torch.zeros(1, dtype=torch.int64))

    def forward(self, rows):
        if self.training:
            self.batch += 1
        return rows[:, :1] * self.script[int(self.batch) - 1] + 0 * self.idle


class TwoLayers(torch.nn.Module):
    """A network that learns, with random numbers in its training."""

    def __init__(self, n_features):
        super().__init__()
        self.layers = torch.nn.Sequential(
            torch.nn.Linear(n_features, 16),
            torch.nn.Tanh(),
            torch.nn.Dropout(0.1),
            torch.nn.Linear(16, 1),
        )

    def forward(self, rows):
        return self.layers(rows)


class KilledError(Exception):
    pass


class Mortal(TwoLayers):
    """Raises an error after a number of batches."""

    lives = float("inf")
    error = KilledError

    def forward(self, rows):
        if self.training:
            Mortal.lives -= 1
            if Mortal.lives < 0:
                raise self.error
        return super().forward(rows)
