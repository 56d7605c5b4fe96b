"""Compiled loops agree with plain ones."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from planners.edge_discretization import split_edges
from planners.search_tree import nearest_rows
from reliability.networks.mlp_inference import mlp_logits
from systems.planar_arm.kernels import limited_targets, transition_features
from systems.rope.rope_length import length_between

points = arrays(np.float64, (3, 3), elements=st.floats(-4, 4))


def plain_logits(rows, layers, slope):
    values = rows.astype(np.float64)
    for i, (weight, bias) in enumerate(layers):
        values = values @ weight + bias
        if i + 1 < len(layers):
            values = np.where(values > 0, values, slope * values)
    return values[:, 0]


@pytest.mark.parametrize("sizes", [(12, 256, 128, 64, 1), (3, 5, 1), (7, 1), (4, 9, 6, 1)])
@pytest.mark.parametrize("n_rows", [1, 5, 8, 19])
def test_network_agrees_with_matrix_products(sizes, n_rows, rng):
    layers = [
        (rng.normal(size=(a, b)) / np.sqrt(a), rng.normal(size=b))
        for a, b in itertools.pairwise(sizes)
    ]
    rows = rng.normal(size=(n_rows, sizes[0])).astype(np.float32)
    parameters = np.concatenate([part.ravel() for layer in layers for part in layer])
    logits = mlp_logits(rows, np.array(sizes), parameters.astype(np.float32), np.float32(0.01))
    np.testing.assert_allclose(logits, plain_logits(rows, layers, 0.01), atol=1e-5)


def test_a_rows_logit_does_not_depend_on_its_batch(rng):
    sizes = np.array([12, 64, 30, 1])
    parameters = rng.normal(size=12 * 64 + 64 + 64 * 30 + 30 + 30 + 1).astype(np.float32)
    rows = rng.normal(size=(21, 12)).astype(np.float32)
    together = mlp_logits(rows, sizes, parameters, np.float32(0.01))
    alone = [mlp_logits(rows[i : i + 1], sizes, parameters, np.float32(0.01))[0] for i in range(21)]
    np.testing.assert_array_equal(together, alone)


def plain_split(start, end, step):
    n = max(1, int(np.ceil(np.linalg.norm(end - start) / step - 1e-9)))
    return np.array([start + (end - start) * (i / n) for i in range(n)] + [end])


@given(points, points, st.floats(0.05, 2))
@settings(deadline=None, derandomize=True)
def test_edges_are_split_as_one_by_one(starts, ends, step):
    origins, targets, edge = split_edges(starts, ends, step)
    for i in range(3):
        states = plain_split(starts[i], ends[i], step)
        np.testing.assert_array_equal(origins[edge == i], states[:-1])
        np.testing.assert_array_equal(targets[edge == i], states[1:])
    assert (np.linalg.norm(targets - origins, axis=1) <= step * (1 + 1e-8)).all()


@given(points, points)
@settings(deadline=None, derandomize=True)
def test_nearest_agrees_with_a_distance_matrix(rows, queries):
    distances = ((rows[None, :, :2] - queries[:, None, :2]) ** 2).sum(axis=2)
    nearest = nearest_rows(rows, 3, 2, queries[:, :2].copy())
    np.testing.assert_allclose(distances[np.arange(3), nearest], distances.min(axis=1))


@given(points, points)
@settings(deadline=None, derandomize=True)
def test_limited_targets_agree_with_vector_arithmetic(current, target):
    way = target - current
    length = np.linalg.norm(way, axis=1, keepdims=True)
    expected = np.where(length <= 0.1, target, current + 0.1 * way / np.maximum(length, 1e-12))
    np.testing.assert_allclose(limited_targets(current, target, 0.1), expected, atol=1e-9)


@given(points, points)
@settings(deadline=None, derandomize=True)
def test_arm_features_agree_with_array_arithmetic(current, following):
    angles = np.cumsum(current, axis=1)
    motion = (following - current) / 0.1
    expected = np.hstack([current, np.sin(angles), np.cos(angles), motion])
    np.testing.assert_allclose(transition_features(current, following, 0.1), expected, atol=1e-12)


@given(points, points)
@settings(deadline=None, derandomize=True)
def test_rope_length_is_that_of_its_edges(grippers, nodes):
    line = np.vstack([grippers[0], nodes, grippers[1]])
    expected = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
    assert length_between(grippers[:2], nodes) == pytest.approx(expected)
