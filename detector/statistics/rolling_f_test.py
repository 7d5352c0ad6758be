r"""Both F-tests over the last samples of a stream, at the cost of a few sums a sample.

The tests need the sums of products of their columns, of pump and system,

$$(1, x, x^2, u, u x, u x^2, y), \quad x = Q / N,\ y = H / N^2 \qquad (1, w, u, u w, H), \quad w = Q_{tot}^2$$

with u the time. Each sample adds its products, the one that leaves the window takes its own away, and a Cholesky
factorisation gives both sums of squared residuals. So that nothing cancels, all is centred and scaled; origin and
scale are taken from the window anew, and the sums with them, once in every length of the window, and whenever a
sample comes or goes that lies further than `REACH` from the origin: a spike leaves no trace when it is gone.
"""

import math

import numpy as np

from wetwell.detector.statistics.curve_drift import CurveFTests, pump_curve_f_test, system_curve_f_test
from wetwell.detector.statistics.f_distribution import log_f_survival
from wetwell.detector.statistics.f_test import FTest
from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.jit import compiled

LEAST_SAMPLES = 7
REACH = 8.0
"""In standard deviations of the window."""
LEAST_PIVOT = 1e-5
"""Share of its length by which a column must stand out from those before it; below, sums lose too many digits."""
PUMP_SIZE, SYSTEM_SIZE = 7, 5
PUMP_NULLS, SYSTEM_NULLS = 3, 2
SYSTEM_ROW, ORIGIN, SCALE, COLUMNS, WORK, FIGURES = 7, 12, 13, 14, 15, 22
"""Rows of `moments`: sums of the pump, of the system, origins and scales of (u, x, y, w, H), the columns of one
sample, the work space of the factorisation, and the figures of both tests after the last sample."""
ROWS = 24
F, LOG_P, AIC_NULL, AIC_ALTERNATIVE = range(4)


@compiled
def _add(
    moments: Floats, time_s: float, flow_m3h: float, head_m: float, speed: float, total_m3h: float, sign: float
) -> bool:
    """Add the products of a sample; whether it lies near enough to the origin."""
    origin, scale, columns = moments[ORIGIN], moments[SCALE], moments[COLUMNS]
    u = (time_s - origin[0]) / scale[0]
    x = (flow_m3h / speed - origin[1]) / scale[1]
    y = (head_m / (speed * speed) - origin[2]) / scale[2]
    w = (total_m3h * total_m3h - origin[3]) / scale[3]
    h = (head_m - origin[4]) / scale[4]
    columns[0], columns[1], columns[2], columns[3] = 1.0, x, x * x, u
    columns[4], columns[5], columns[6] = u * x, u * x * x, y
    for i in range(PUMP_SIZE):
        for j in range(i + 1):
            moments[i, j] += sign * columns[i] * columns[j]
    columns[1], columns[2], columns[3], columns[4] = w, u, u * w, h
    for i in range(SYSTEM_SIZE):
        for j in range(i + 1):
            moments[SYSTEM_ROW + i, j] += sign * columns[i] * columns[j]
    return bool(max(abs(u), abs(x), abs(y), abs(w), abs(h)) <= REACH)


@compiled
def _begin_anew(window: Floats, moments: Floats, samples: int) -> None:
    """Take origin, scale and sums from the window itself."""
    mean, deviation = moments[ORIGIN], moments[SCALE]
    for power in range(2):
        moments[SCALE if power else ORIGIN] = 0.0
        for at in range(samples):
            speed = window[3, at]
            columns = moments[COLUMNS]
            columns[0], columns[1], columns[2] = window[0, at], window[1, at] / speed, window[2, at] / (speed * speed)
            columns[3], columns[4] = window[4, at] * window[4, at], window[2, at]
            for i in range(5):
                if power:
                    deviation[i] += (columns[i] - mean[i]) ** 2 / samples
                else:
                    mean[i] += columns[i] / samples
    for i in range(5):
        deviation[i] = math.sqrt(deviation[i]) if deviation[i] > 0.0 else 1.0
    moments[:ORIGIN] = 0.0
    for at in range(samples):
        _add(moments, window[0, at], window[1, at], window[2, at], window[3, at], window[4, at], 1.0)


@compiled
def add_sample(
    window: Floats,
    moments: Floats,
    counts: Integers,
    time_s: float,
    flow_m3h: float,
    head_m: float,
    speed: float,
    total_m3h: float,
) -> None:
    """Put a sample in the place of the oldest one.

    Parameters
    ----------
    window : (5, n) array
        Ring of time, flow, head, speed ratio, total flow.
    moments : (ROWS, 7) array
    counts : (2,) int64
        Samples taken, and those since origin and scale were taken anew.
    """
    length = window.shape[1]
    at = counts[0] % length
    is_near = True
    if counts[0] >= length:
        is_near = _add(moments, window[0, at], window[1, at], window[2, at], window[3, at], window[4, at], -1.0)
    window[0, at], window[1, at], window[2, at], window[3, at] = time_s, flow_m3h, head_m, speed
    window[4, at] = total_m3h
    counts[0] += 1
    counts[1] += 1
    is_near = _add(moments, time_s, flow_m3h, head_m, speed, total_m3h, 1.0) and is_near
    if not is_near or counts[1] >= length:
        counts[1] = 0
        _begin_anew(window, moments, min(counts[0], length))


@compiled
def _solve(moments: Floats, first: int, size: int, nulls: int, scale: float, out: Floats) -> bool:
    """F, log p and both AIC from the sums of one test; False where they have lost too many digits."""
    work = moments[WORK:]
    for i in range(size):
        for j in range(i + 1):
            rest = moments[first + i, j]
            for k in range(j):
                rest -= work[i, k] * work[j, k]
            if i > j:
                work[i, j] = rest / work[j, j]
            elif rest > LEAST_PIVOT * moments[first + i, i]:
                work[i, i] = math.sqrt(rest)
            else:
                return False
    last, samples = size - 1, moments[first, 0]
    rest, explained = work[last, last] ** 2, 0.0
    for k in range(nulls, last):
        explained += work[last, k] ** 2
    added, free = last - nulls, samples - last
    out[F] = explained / added / (rest / free)
    out[LOG_P] = log_f_survival(out[F], added, free)
    unit = scale * scale / samples
    out[AIC_NULL] = samples * math.log((rest + explained) * unit) + 2 * nulls
    out[AIC_ALTERNATIVE] = samples * math.log(rest * unit) + 2 * last
    return True


@compiled
def solve(moments: Floats, figures: Floats) -> bool:
    """Both tests as (2, 4) figures: F, log p and both AIC of pump and system; False where they have to be fitted."""
    is_sure = _solve(moments, 0, PUMP_SIZE, PUMP_NULLS, moments[SCALE, 2], figures[0])
    return _solve(moments, SYSTEM_ROW, SYSTEM_SIZE, SYSTEM_NULLS, moments[SCALE, 4], figures[1]) and is_sure


@compiled
def _scan(samples: Floats, window: Floats, moments: Floats, counts: Integers, figures: Floats) -> None:
    for n in range(samples.shape[1]):
        add_sample(window, moments, counts, samples[0, n], samples[1, n], samples[2, n], samples[3, n], samples[4, n])
        if n + 1 < LEAST_SAMPLES or not solve(moments, figures[n]):
            figures[n] = math.nan


def scan(samples: Floats, window_samples: int) -> Floats:
    """Both tests after each sample, over the last ones.

    Parameters
    ----------
    samples : (5, n) array
        Time, flow, head, speed ratio, total flow.
    window_samples : int
        Length of the window, >= 7.

    Returns
    -------
    figures : (n, 2, 4) array
        Of pump and system: F, log p, AIC of null model and of alternative; NaN until there are 7 samples.
    """
    rolling, figures = RollingFTest(window_samples), np.empty((samples.shape[1], 2, 4))
    _scan(samples, *rolling.arrays(), figures)
    for n in np.flatnonzero(np.isnan(figures[LEAST_SAMPLES - 1 :, 0, 0])) + LEAST_SAMPLES - 1:
        tests = _fitted(samples[:, max(n + 1 - window_samples, 0) : n + 1])
        figures[n] = [(t.f, t.log_p, t.aic_null, t.aic_alternative) for t in (tests.pump, tests.system)]
    return figures


def _fitted(samples: Floats) -> CurveFTests:
    """Both tests on samples themselves."""
    time_s, flow, head, speed, total = samples
    return CurveFTests(
        pump=pump_curve_f_test(time_s, flow, head, speed), system=system_curve_f_test(time_s, total, head)
    )


class RollingFTest:
    """Both tests over the last samples of each of some pumps.

    Where the sums do not tell enough (a spike within the window, a perfect fit, a constant flow) the window itself is
    tested. Memory: O(window); warm-up: 7 samples.

    Parameters
    ----------
    window_samples : int
        Length of the window, >= 7.
    pumps : int

    Raises
    ------
    ValueError
        If the window is too short.

    Examples
    --------
    >>> rolling = RollingFTest(50)
    >>> for second in range(60):
    ...     rolling.update(second, 150.0 + 10.0 * math.sin(second), 15.0 + 0.01 * second, 1.0)
    >>> tests = rolling.value()
    >>> tests.pump.samples, tests.system.log_p < -100.0
    (50, True)
    """

    __slots__ = ("counts", "moments", "windows")

    def __init__(self, window_samples: int, pumps: int = 1) -> None:
        if window_samples < LEAST_SAMPLES:
            raise ValueError(f"window_samples must be {LEAST_SAMPLES} or more, got {window_samples}")
        self.windows = np.zeros((pumps, 5, window_samples))
        self.moments = np.zeros((pumps, ROWS, PUMP_SIZE))
        self.counts = np.zeros((pumps, 2), dtype=np.int64)

    def arrays(self, pump: int = 0) -> tuple[Floats, Floats, Integers]:
        """State of one pump, as compiled code takes it."""
        return self.windows[pump], self.moments[pump], self.counts[pump]

    def update(
        self,
        time_s: float,
        flow_m3h: float,
        head_m: float,
        speed_ratio: float,
        total_flow_m3h: float | None = None,
    ) -> None:
        """Take one sample of the first pump; `total_flow_m3h` is that of the rising main where it is not the pump's.

        Raises
        ------
        ValueError
            If a value is not finite or the speed not positive; the window is left as it was.
        """
        total = flow_m3h if total_flow_m3h is None else total_flow_m3h
        if not (math.isfinite(time_s + flow_m3h + head_m + total) and 0.0 < speed_ratio < math.inf):
            raise ValueError(
                "a sample must be finite and its speed_ratio positive, "
                f"got {(time_s, flow_m3h, head_m, speed_ratio, total)}"
            )
        add_sample(*self.arrays(), float(time_s), flow_m3h, head_m, speed_ratio, total)

    def samples(self, pump: int = 0) -> Floats:
        """Window as a (5, n) array, oldest first: time, flow, head, speed ratio, total flow."""
        window, _, (count, _) = self.arrays(pump)
        if count <= window.shape[1]:
            return window[:, :count].copy()
        return np.roll(window, -int(count) % window.shape[1], axis=1)

    def value(self, pump: int = 0) -> CurveFTests | None:
        """Both tests over the window; None until it holds 7 samples."""
        window, moments, (count, _) = self.arrays(pump)
        if count < LEAST_SAMPLES:
            return None
        figures = np.empty((2, 4))
        if not solve(moments, figures):
            return _fitted(self.samples(pump))
        samples = min(int(count), window.shape[1])
        tests = [
            FTest(f=f, log_p=log_p, aic_null=null, aic_alternative=alternative, samples=samples)
            for f, log_p, null, alternative in figures.tolist()
        ]
        return CurveFTests(pump=tests[0], system=tests[1])
