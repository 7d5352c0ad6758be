"""Inflow of a catchment: days and weeks, correlated noise, storms."""

import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.jit import compiled
from wetwell.protocols.station.table import NonNegative, Positive, Table
from wetwell.simulator.wet_well import SECONDS_PER_HOUR

HOURS = (
    *(0.55, 0.42, 0.34, 0.3, 0.34, 0.55, 1.05, 1.65, 1.8, 1.55, 1.25, 1.1),
    *(1.05, 1.0, 0.95, 0.92, 0.95, 1.08, 1.3, 1.5, 1.48, 1.25, 0.98, 0.74),
)
SECONDS_PER_DAY = 86400.0
FIRST_WEEKEND_DAY = 6
STORM_LENGTH = 30.0
"""Length of a storm in times to its peak; by then less than 1e-10 of the peak is left."""


class CatchmentInflow(Table):
    r"""Smooth days and weeks, AR(1) noise, and storms that arrive as a Poisson process; never negative.

    $$Q(t) = \max\Bigl(0,\ \bar Q\, p(t) + \varepsilon(t)\Bigr)
    + \sum_i Q_i \Bigl(\frac{t - t_i}{t_p}\Bigr)^n e^{n (1 - (t - t_i) / t_p)}$$
    $$\varepsilon(t + \Delta t) = a\, \varepsilon(t) + \sigma \sqrt{1 - a^2}\, z, \qquad a = e^{-\Delta t / \tau},
    \qquad z \sim N(0, 1), \qquad Q_i \sim \text{Exp}(\bar Q_s)$$

    p is a cubic spline of the Catmull and Rom kind through the hours of the week, so that the weekend comes within an
    hour about midnight.

    Parameters
    ----------
    mean_m3h : float
        Mean of a dry weekday. [m³/h]
    hours : 24 floats
        Inflow at each full hour of a day, from midnight on, relative to each other. [1]
    weekend_factor : float
        Saturday and Sunday against a weekday. [1]
    first_weekday : int
        Day on which the scenario starts, at midnight: 1 Monday to 7 Sunday; the default date of a scenario is a
        Wednesday.
    noise_m3h, correlation_s : float
        σ, standard deviation of the noise, and τ, the time in which its correlation falls to 1/e. [m³/h, s]
    storms_per_day : float
        Mean number of storms. [1/d]
    storm_peak_m3h : float
        Mean of the peaks of the storms. [m³/h]
    storm_time_to_peak_s : float
        t_p, from the begin of a storm to its peak. [s]
    storm_shape : float
        n, form of a storm: the larger, the shorter the storm about its peak. [1]

    References
    ----------
    .. [1] After V. P. Singh, Hydrologic Systems: gamma-shaped unit hydrograph of Nash.
    .. [2] After G. E. P. Box, G. M. Jenkins, Time Series Analysis: first-order autoregressive process.
    .. [3] Eshkofti et al., Modeling and physics-enhanced fault detection in wastewater pump stations: the defaults
       have about the median and the 95th percentile of its inflow (0.016 and 0.032 m³/s).
    """

    kind: Literal["catchment"] = "catchment"
    mean_m3h: NonNegative = 57.0
    hours: Annotated[tuple[NonNegative, ...], Field(min_length=24, max_length=24)] = HOURS
    weekend_factor: NonNegative = 1.1
    first_weekday: Annotated[int, Field(ge=1, le=7)] = 3
    noise_m3h: NonNegative = 15.0
    correlation_s: Positive = 900.0
    storms_per_day: Annotated[float, Field(ge=0, le=1000)] = 0.3
    storm_peak_m3h: NonNegative = 60.0
    storm_time_to_peak_s: Positive = 5400.0
    storm_shape: Annotated[float, Field(ge=1, le=20)] = 2.0

    @model_validator(mode="after")
    def _check_hours(self) -> Self:
        if sum(self.hours) == 0.0:
            raise ValueError("hours: at least one must be above 0")
        return self

    def stream(self, rng: np.random.Generator) -> "CatchmentStream":
        """Stream of this inflow."""
        return CatchmentStream(self, *rng.spawn(2))


class CatchmentStream:
    """A running inflow of a catchment; remembers the last noise, the storms that last and the one to come."""

    def __init__(
        self, inflow: CatchmentInflow, noise_rng: np.random.Generator, storm_rng: np.random.Generator
    ) -> None:
        self._inflow = inflow
        self._pieces = _week_pieces(inflow)
        self._noise_rng = noise_rng
        self._noise_m3h = inflow.noise_m3h * noise_rng.standard_normal()
        self._storm_rng = storm_rng
        self._storms: list[tuple[float, float]] = []
        self._next_storm = (0.0, 0.0)
        self._draw_storm()
        self._time_s = 0

    def next_seconds(self, seconds: int) -> Floats:
        """(seconds,) inflow of the next seconds, in m³/h."""
        first_s = self._time_s
        self._time_s += seconds
        flow_m3h = self._dry_m3h(np.arange(first_s, self._time_s)) + self._next_noise_m3h(seconds)
        np.maximum(flow_m3h, 0.0, out=flow_m3h)
        while self._next_storm[0] < self._time_s:
            self._storms.append(self._next_storm)
            self._draw_storm()
        time_to_peak_s = self._inflow.storm_time_to_peak_s
        for begin_s, peak_m3h in self._storms:
            _add_storm(flow_m3h, first_s, begin_s, peak_m3h, time_to_peak_s, self._inflow.storm_shape)
        lasts_s = STORM_LENGTH * time_to_peak_s
        self._storms = [storm for storm in self._storms if storm[0] + lasts_s >= self._time_s]
        return flow_m3h

    def _dry_m3h(self, time_s: Integers) -> Floats:
        hour, second = np.divmod(time_s, SECONDS_PER_HOUR)
        c0, c1, c2, c3 = self._pieces[:, hour % self._pieces.shape[1]]
        u = second / SECONDS_PER_HOUR
        dry_m3h: Floats = ((c3 * u + c2) * u + c1) * u + c0
        return dry_m3h

    def _next_noise_m3h(self, seconds: int) -> Floats:
        noise_m3h = self._noise_rng.standard_normal(seconds)
        kept = math.exp(-1.0 / self._inflow.correlation_s)
        fresh_m3h = self._inflow.noise_m3h * math.sqrt(-math.expm1(-2.0 / self._inflow.correlation_s))
        self._noise_m3h = _correlate(noise_m3h, kept, fresh_m3h, self._noise_m3h)
        return noise_m3h

    def _draw_storm(self) -> None:
        """Draw the storm to come: its beginning and its peak."""
        if self._inflow.storms_per_day == 0.0:
            self._next_storm = (math.inf, 0.0)
            return
        gap_s = self._storm_rng.exponential(SECONDS_PER_DAY / self._inflow.storms_per_day)
        peak_m3h = self._storm_rng.exponential(self._inflow.storm_peak_m3h)
        self._next_storm = (self._next_storm[0] + gap_s, peak_m3h)


def _week_pieces(inflow: CatchmentInflow) -> Floats:
    """(4, 168) coefficients of the cubics in each hour of the week that begins with the scenario, in m³/h."""
    hours = np.array(inflow.hours)
    weekdays = (inflow.first_weekday - 1 + np.arange(7)) % 7 + 1
    days = np.where(weekdays >= FIRST_WEEKEND_DAY, inflow.weekend_factor, 1.0)
    flow_m3h = inflow.mean_m3h * np.outer(days, hours / hours.mean()).ravel()
    rise = np.roll(flow_m3h, -1) - flow_m3h
    slope = (np.roll(flow_m3h, -1) - np.roll(flow_m3h, 1)) / 2.0
    next_slope = np.roll(slope, -1)
    return np.array([flow_m3h, slope, 3.0 * rise - 2.0 * slope - next_slope, slope + next_slope - 2.0 * rise])


@compiled
def _correlate(noise: Floats, kept: float, fresh: float, last: float) -> float:
    """Turn white noise into AR(1) noise in place, from the last value on; the new last value."""
    for k in range(noise.size):
        last = kept * last + fresh * noise[k]
        noise[k] = last
    return last


@compiled
def _add_storm(
    flow_m3h: Floats, first_s: int, begin_s: float, peak_m3h: float, time_to_peak_s: float, shape: float
) -> None:
    """Add a storm to the flow of a block that begins at `first_s`."""
    begin = max(math.ceil(begin_s) - first_s, 0)
    end = min(int(begin_s + STORM_LENGTH * time_to_peak_s) + 1 - first_s, flow_m3h.size)
    for k in range(begin, end):
        age = (first_s + k - begin_s) / time_to_peak_s
        flow_m3h[k] += peak_m3h * (age * math.exp(1.0 - age)) ** shape
