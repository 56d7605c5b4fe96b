"""Arguments are checked where they are given, and messages say what is wrong with them."""

from fractions import Fraction

import numpy as np
import pytest

from systems.validation import (
    as_finite_array,
    as_generator,
    as_row_pair,
    as_rows,
    as_seed,
    check_count,
    check_number,
    check_within_bounds,
)


@pytest.mark.parametrize("integer", [3, np.int8(3), np.uint64(3), np.random.SeedSequence(3)])
def test_equal_seeds_give_equal_draws(integer):
    expected = np.random.default_rng(3).random(4)
    np.testing.assert_array_equal(as_generator(integer).random(4), expected)


def test_generators_advance():
    rng = np.random.default_rng(0)
    assert as_generator(rng) is rng
    assert as_seed(rng) != as_seed(rng)
    legacy = np.random.RandomState(0)
    assert as_generator(legacy).random() != as_generator(legacy).random()
    assert (
        as_generator(np.random.RandomState(5)).random()
        == as_generator(np.random.RandomState(5)).random()
    )


def test_no_seed_differs_each_time():
    assert as_generator(None).random() != as_generator(None).random()
    assert as_seed(None) != as_seed(None)


def test_a_seed_is_a_plain_integer_and_an_integer_its_own():
    assert as_seed(7) == 7
    assert type(as_seed(np.uint8(7))) is int
    assert 0 <= as_seed(np.random.default_rng(1)) < 2**63
    assert as_seed(np.random.default_rng(1)) == as_seed(np.random.default_rng(1))


@pytest.mark.parametrize("of", [as_generator, as_seed])
@pytest.mark.parametrize("value", [True, 1.0, "1", [1], np.bool_(False)])
def test_other_seeds_are_refused(of, value):
    with pytest.raises(ValueError, match="random_state must be None, an integer, or a numpy"):
        of(value)


@pytest.mark.parametrize("of", [as_generator, as_seed])
@pytest.mark.parametrize("value", [-1, np.int64(-4)])
def test_negative_seeds_are_refused(of, value):
    with pytest.raises(ValueError, match=f"random_state must not be negative, got {value}"):
        of(value)


@pytest.mark.parametrize("value", [1, 2**63 - 1, np.uint8(1), np.int64(5)])
def test_counts_pass(value):
    check_count(value, "n")


@pytest.mark.parametrize("value", [0, -1, 1.0, np.float64(2), True, np.bool_(True), "3", None])
def test_other_counts_are_refused(value):
    with pytest.raises(ValueError, match="n must be a positive integer, got "):
        check_count(value, "n")


def test_counts_fit_into_64_bits():
    with pytest.raises(ValueError, match=r"n must be less than 2\*\*63, got 9223372036854775808"):
        check_count(2**63, "n")


@pytest.mark.parametrize(
    "value",
    [2, 5, 3.5, np.float32(5), np.float16(2), np.int32(3), Fraction(5, 2)],
)
def test_numbers_pass_and_limits_are_included(value):
    check_number(value, "k", 2, 5)


@pytest.mark.parametrize(
    "value", [True, np.bool_(True), "3", None, np.nan, 1.99, 5.01, np.complex64(3), [3], np.ones(1)]
)
def test_other_numbers_are_refused(value):
    with pytest.raises(ValueError, match=r"k must be a number between 2 and 5, got "):
        check_number(value, "k", 2, 5)


@pytest.mark.parametrize("truth", [True, np.bool_(True)])
def test_truth_is_no_number(truth):
    with pytest.raises(ValueError, match="k must be a number between 0 and 1, got"):
        check_number(truth, "k", 0, 1)


def test_limits_may_be_too_large_for_a_numbers_type():
    check_number(np.float16(2.0), "k", 0.0, 1e9)
    with pytest.raises(ValueError, match="k must be a number between"):
        check_number(np.float16(2.0), "k", 3.0, 1e9)


def test_arrays_become_float64_and_fitting_ones_stay_themselves():
    array = np.arange(6.0).reshape(2, 3)
    assert as_finite_array(array, "a", (None, 3)) is array
    for values in ([[1, 2], [3, 4]], np.float32([[1, 2], [3, 4]]), np.array([[1, 2], [3, 4]], "O")):
        converted = as_finite_array(values, "a", (2, None))
        assert converted.dtype == np.float64
        assert converted.tolist() == [[1, 2], [3, 4]]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([1, 2], r"a must have the shape \(any, 2\), got \(2,\)"),
        ([[1, 2, 3]], r"a must have the shape \(any, 2\), got \(1, 3\)"),
        ([[1, 2], [3, np.inf]], "a must be finite, got NaN or infinity in "),
        ([[None, 2]], "a must be finite"),
        ([[1, 2], [3]], r"a must be an array of numbers, got \[\[1, 2\], \[3\]\]"),
        ([["1", "2"]], "a must be an array of numbers"),
        (np.array([[1, 2j]]), "a must be an array of numbers"),
        (np.array([[1, "x"]], dtype=object), "a must be an array of numbers"),
        (np.array([["2020-01-01"] * 2], dtype="M8[D]"), "a must be an array of numbers"),
    ],
)
def test_other_arrays_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        as_finite_array(values, "a", (None, 2))


def test_messages_on_large_arrays_are_short():
    with pytest.raises(ValueError, match="a must be finite") as caught:
        as_finite_array(np.full((1000, 1000), np.nan), "a", (None, None))
    assert len(str(caught.value)) < 200


def test_numbers_whose_squares_are_infinite_are_finite():
    large = np.array([[1e300, -1e200]])
    assert as_finite_array(large, "a", (None, 2)) is large
    empty = np.empty((0, 2))
    assert as_finite_array(empty, "a", (None, 2)) is empty
    with pytest.raises(ValueError, match="a must be finite"):
        as_finite_array(np.array([[1e300, -np.inf]]), "a", (None, 2))


def test_rows_that_are_right_are_returned_as_they_are():
    good, none = np.zeros((2, 3)), np.zeros((0, 3))
    first, second = as_rows("poses", 3, first=good, second=none)
    assert first is good
    assert second is none
    (converted,) = as_rows("poses", 3, rows=[[1, 2, 3]])
    np.testing.assert_array_equal(converted, [[1.0, 2.0, 3.0]])


@pytest.mark.parametrize("bad", [np.zeros(3), np.zeros((3, 2)), [[0, 0]], 1.0])
def test_rows_of_other_shapes_are_refused(bad):
    with pytest.raises(ValueError, match=r"second must be poses, of shape \(n, 3\), got the shape"):
        as_rows("poses", 3, first=np.zeros((2, 3)), second=bad)


def test_pairs_of_rows_have_the_same_length():
    with pytest.raises(ValueError, match="b must have as many rows as a, 2, got 1"):
        as_row_pair("poses", 3, a=np.zeros((2, 3)), b=np.zeros((1, 3)))


def test_bounds_are_included_and_the_first_row_outside_is_named():
    bounds = np.array([[-1.0, 0.0], [1.0, 2.0]])
    check_within_bounds(np.array([1.0, 0.0]), bounds, "q")
    check_within_bounds(np.array([[1.0, 0.0], [-1.0, 2.0]]), bounds, "q")
    with pytest.raises(ValueError, match=r"q must lie within .* \[1.0, 2.0\], got \[0.0, 2.5\]"):
        check_within_bounds(np.array([0.0, 2.5]), bounds, "q")
    rows = np.array([[0.0, 1.0], [-1.5, 1.0], [0.0, -9.0]])
    with pytest.raises(ValueError, match=r"got \[-1.5, 1.0\]"):
        check_within_bounds(rows, bounds, "q")
