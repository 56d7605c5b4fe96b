"""Angles are brought to [-π, π), and differences go the shorter way around the circle."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from systems.angles import shortest_way, wrap_angle, wrap_columns

angles = st.floats(-1e4, 1e4)
rows = arrays(np.float64, (2, 3, 4), elements=angles)


@settings(deadline=None, derandomize=True)
@given(angles)
def test_a_wrapped_angle_is_the_same_direction_in_range(angle):
    wrapped = wrap_angle(angle)
    assert -np.pi <= wrapped < np.pi
    assert np.cos(wrapped) == pytest.approx(np.cos(angle), abs=1e-9)
    assert np.sin(wrapped) == pytest.approx(np.sin(angle), abs=1e-9)


@pytest.mark.parametrize("angle", [-np.pi, -0.0, 1e-300, 3.0, np.nextafter(np.pi, 0)])
def test_an_angle_in_range_stays_as_it_is(angle):
    assert wrap_angle(angle) == angle


@pytest.mark.parametrize("neighbour", [-2, -1, 0, 1, 2])
def test_the_ends_of_the_range_are_one_angle(neighbour):
    for turns in [*range(-300, 300), 10**6]:
        angle = np.pi + 2 * np.pi * turns
        wrapped = wrap_angle(angle + neighbour * np.spacing(angle))
        assert -np.pi <= wrapped < np.pi
        assert abs(wrapped) == pytest.approx(np.pi, abs=1e-8)


@settings(deadline=None, derandomize=True)
@given(st.floats(-1e15, 1e15))
def test_rounding_never_leads_out_of_the_range(angle):
    for at in (angle, np.pi * np.round(angle / np.pi), 4.58952998e12):
        assert -np.pi <= wrap_angle(at) < np.pi


@settings(deadline=None, derandomize=True)
@given(rows)
def test_only_columns_of_angles_are_wrapped_and_in_a_copy(given_rows):
    before = given_rows.copy()
    for array in (given_rows, given_rows[0], given_rows[0, 0], given_rows[:, ::-1]):
        wrapped = wrap_columns(array, (1, 3))
        np.testing.assert_array_equal(wrapped[..., [0, 2]], array[..., [0, 2]])
        expected = np.vectorize(wrap_angle)(array[..., [1, 3]])
        np.testing.assert_array_equal(wrapped[..., [1, 3]], expected)
    np.testing.assert_array_equal(given_rows, before)
    np.testing.assert_array_equal(wrap_columns(given_rows, ()), given_rows)


@settings(deadline=None, derandomize=True)
@given(rows, rows)
def test_differences_lead_to_the_end_and_turn_by_half_a_circle_at_most(starts, ends):
    way = shortest_way(starts, ends, (0,))
    np.testing.assert_array_equal(way[..., 1:], (ends - starts)[..., 1:])
    assert (np.abs(way[..., 0]) <= np.pi).all()
    np.testing.assert_allclose(np.exp(1j * (starts + way)[..., 0]), np.exp(1j * ends[..., 0]))


def test_the_shorter_way_crosses_the_end_of_the_range():
    way = shortest_way(np.array([[3.1, 0.0]]), np.array([[-3.1, 0.0]]), (0,))
    np.testing.assert_allclose(way, [[2 * np.pi - 6.2, 0.0]])
