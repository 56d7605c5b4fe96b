"""Transitions whose labels and features are written down, for tests."""

from __future__ import annotations

import numpy as np
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.frozen import FrozenEstimator
from toy_systems import Disc

from reliability import RELIABLE, UNRELIABLE, Transitions


class Table(Disc):
    """A system whose features are the numbers of its reduced state."""

    def __init__(self, reduced_dim=2, dtype=float):
        super().__init__()
        self.reduced_dim = reduced_dim
        self.dtype = dtype

    def features(self, reduced, next_reduced):
        return reduced.astype(self.dtype)


class Scripted(ClassifierMixin, BaseEstimator):
    """Predicts what the first feature says, with the probability that the second says."""

    classes_ = np.array([UNRELIABLE, RELIABLE])

    def fit(self, X, y):
        return self

    def predict(self, X):
        return X[:, 0].astype(int)

    def predict_proba(self, X):
        return np.column_stack([1 - X[:, 1], X[:, 1]])


def scripted():
    return FrozenEstimator(Scripted())


def table(features, labels_per_plan, executed=None):
    """Make transitions of features (n, d) and of each plan's labels."""
    sizes = [len(labels) for labels in labels_per_plan]
    n = sum(sizes)
    X = np.asarray(features, dtype=float)
    return Transitions(
        reduced=X,
        command=np.ones((n, 1)),
        next_reduced=X,
        y=np.concatenate(labels_per_plan),
        plan=np.repeat(np.arange(len(sizes)), sizes),
        step=np.concatenate([np.arange(size) for size in sizes]),
        executed=None if executed is None else np.full(n, executed),
    )


def pushed_box(rng, n_plans=200, n_features=4):
    """Make labels of Eq. 3 with the shares that a pushed box had, and features of noise.

    93.5 % of the labels are Unreliable, and 94 % of those come after a divergence.
    """
    plans = [
        [RELIABLE] * (1 + (i % 10 == 0)) + [UNRELIABLE] * (15 + (i % 5 > 0)) for i in range(n_plans)
    ]
    return table(rng.normal(size=(sum(map(len, plans)), n_features)), plans)


def executed_steps(rng, n_plans=120, n_steps=8, noise=0.0, bias=0.0):
    """Make labels from executed states that the first of three features tells, but for noise."""
    X = rng.normal(size=(n_plans * n_steps, 3))
    y = (X[:, 0] + noise * rng.normal(size=len(X)) > bias).astype(int)
    return table(X, y.reshape(n_plans, n_steps), executed=True)
