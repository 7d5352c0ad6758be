"""Medians and quantiles against NumPy's."""

import numpy as np
import pytest

from wetwell.detector.statistics.robust import median, quantiles


@pytest.mark.parametrize("length", [1, 2, 3, 10, 251])
def test_medians_and_quantiles_are_those_of_numpy(length):
    values = np.random.default_rng(length).normal(size=(length, 2))
    np.testing.assert_array_equal(median(values), np.median(values, axis=0))
    shares = (0.0, 0.025, 0.5, 0.9, 1.0)
    np.testing.assert_allclose(quantiles(values[:, 0], shares), np.quantile(values[:, 0], shares), rtol=1e-14)


def test_one_value_that_is_not_known_makes_the_median_unknown():
    values = np.array([[1.0, 2.0], [np.nan, 3.0], [5.0, 1.0]])
    np.testing.assert_array_equal(median(values), [np.nan, 2.0])
