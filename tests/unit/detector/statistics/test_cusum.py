"""The two-sided CUSUM: silent in health, quick at a shift, and not tripped by one burst."""

import numpy as np
import pytest

from wetwell.detector.statistics.cusum import DEAD_BAND, LARGEST_STEP, THRESHOLD, Cusum

DEVIATION_M = np.array([0.1, 0.2])


def trips(cusum, z):
    """What each segment brings, given its distance in standard deviations."""
    return [cusum.update(np.asarray(row) * DEVIATION_M, DEVIATION_M) for row in z]


def by_loop(values):
    """The textbook recursion of one sum."""
    total, sums = 0.0, []
    for value in values:
        total = max(0.0, total + min(value - DEAD_BAND, LARGEST_STEP))
        sums.append(total)
    return sums


def test_the_sums_are_those_of_the_textbook():
    cusum, z = Cusum(), np.random.default_rng(0).normal(0.3, 1.5, (200, 2))
    sums = []
    for row in z:
        cusum.update(row * DEVIATION_M, DEVIATION_M)
        sums.append(cusum.sums.copy())
    expected = np.array([[by_loop(sign * z[:, column]) for column in (0, 1)] for sign in (1.0, -1.0)])
    np.testing.assert_allclose(np.transpose(sums, (1, 2, 0)), expected, atol=1e-9)


@pytest.mark.parametrize("column", [0, 1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_shift_of_either_curve_either_way_trips_and_dates_itself(column, sign):
    cusum = Cusum()
    healthy, shifted = np.zeros((10, 2)), np.zeros((6, 2))
    shifted[:, column] = 2.0 * sign
    assert not any(trips(cusum, healthy))
    since = trips(cusum, shifted)
    needed = int(THRESHOLD // (2.0 - DEAD_BAND)) + 1
    assert since == [0] * (needed - 1) + list(range(needed, 7))


def test_one_burst_alone_does_not_trip():
    assert not any(trips(Cusum(), [[-1e6, 1e6], *[[0.0, 0.0]] * 20]))


def test_two_in_a_row_do():
    assert trips(Cusum(), [[50.0, 0.0]] * 2) == [0, 2]


def test_it_seldom_trips_within_a_healthy_run():
    rng = np.random.default_rng(1)
    runs = sum(any(trips(Cusum(), rng.normal(size=(10, 2)))) for _ in range(1000))
    assert runs < 50


def test_a_new_run_begins_anew():
    cusum = Cusum()
    assert trips(cusum, [[9.0, 9.0]] * 3)[-1] == 3
    cusum.reset()
    assert trips(cusum, [[0.0, 0.0]]) == [0]
    assert trips(cusum, [[9.0, 9.0]]) == [0]
