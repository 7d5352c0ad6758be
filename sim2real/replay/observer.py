"""How far each recorded level moves the replay, and how far a right replay may be off before it."""

from dataclasses import dataclass, replace

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.jit import compiled
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.inflow_process import InflowProcess
from wetwell.sim2real.replay.level_filter import BEGUN_ANEW, MOST_FOLLOWED, Uncertain, level_filter
from wetwell.sim2real.replay.level_noise import told_noise_m
from wetwell.sim2real.replay.metered_inflow import MeteredInflow
from wetwell.simulator.parameters import SensorParameters, plant_parameters

LEVEL_TIME_S = 150.0
"""Time constant with which the observer follows the recorded level where the inflow is measured."""
LOST_S = 300
"""After that long without a level, and more than two rows, the observer begins anew."""
FIRST_SHARE = 0.5
"""Standard deviation of an inflow before anything is known of it, as a share of what a pump carries."""
RANGE = (0.05, 0.95)
"""Quantiles of the level between which the wet well is emptied and filled."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Observer:
    """Gains of the observer for each value of the level, and what a right model may be off before it.

    Attributes
    ----------
    level_m : (n,) array
        Level that is followed, NaN where there is none. [m]
    level_gain, inflow_gain : (n,) arrays
        Shares of the error of a value by which the level, and the inflow over the area, are moved. [1, 1/s]
    sensor_gain : (2, n) array
        The same of what both filters of the sensor hold; of the second 1 where all begins anew, else less. [1]
    deviation_m : (n,) array or None
        Standard deviation of the error under a right model, noise of the value included; None where the gains are
        constant, as with a measured inflow of each second; infinite where the level is not predicted at all. [m]
    process : InflowProcess or None
        From which the gains of a lag come; None where they are constant, or those of a lag.
    is_of_steps : bool
        Whether the level is rounded, and known when it passes from one step to the next: no other value counts.
    inflow_kept : float
        Share of what was given to the inflow that is left after a second: errors of its readings go over. [1]
    """

    level_m: Floats
    level_gain: Floats
    inflow_gain: Floats
    sensor_gain: Floats
    deviation_m: Floats | None
    process: InflowProcess | None = None
    is_of_steps: bool = False
    inflow_kept: float = 1.0

    def of_late_level(self, late_s: int) -> "Observer":
        """The same where a level is recorded so much after it was: its values are taken when they were.

        An observer that waited for them would swing: its corrections would come late.
        """
        if late_s == 0:
            return self
        none = np.zeros(late_s)
        return replace(
            self,
            level_m=np.r_[self.level_m[late_s:], none + np.nan],
            level_gain=np.r_[self.level_gain[late_s:], none],
            inflow_gain=np.r_[self.inflow_gain[late_s:], none],
            sensor_gain=np.c_[self.sensor_gain[:, late_s:], [none, none]],
        )

    def of_lagging_level(self, sensor: SensorParameters) -> "Observer":
        """The same where the sensor lags: an error of its value says more of the level, and later.

        With the gains of a sensor that does not, the inflow would swing with the time of the lag.
        """
        if self.process is None or sensor.followed >= 1.0:
            return self
        gains, variance_m2 = level_filter(self.process.at(sensor), sensor)
        return replace(
            self,
            level_gain=gains[0],
            inflow_gain=gains[1],
            sensor_gain=gains[2:],
            deviation_m=np.sqrt(variance_m2),
            process=None,
        )

    def left_m(self, gained_m: Floats, misread_m: Floats) -> Floats:
        r"""What an error of the balance, or of the reading, leaves of itself before each value corrects it.

        $$e_k = e_{k-1} + b_{k-1} + g_k, \qquad i_k = e_k + m_k, \qquad
        e_k \leftarrow e_k - K_k i_k, \quad b_k = \kappa b_{k-1} - K_{b,k} i_k$$

        with κ the share of what was given to the inflow that is left after a second.

        Parameters
        ----------
        gained_m : (n,) array
            g, by which the level of the replay goes wrong in each second. [m]
        misread_m : (n,) array
            m, by which the reading is wrong. [m]

        Returns
        -------
        (n,) array
            i, also where there is no value: of a level that is held, only changes are one. [m]
        """
        left = np.zeros(self.level_m.size)
        is_known = np.isfinite(self.level_m)
        _leave(is_known, self.level_gain, self.inflow_gain, self.inflow_kept, gained_m, misread_m, left)
        return left


def lost_after_s(told_m: Floats, level_m: Floats) -> int:
    """Time without a value after which a level is lost: `LOST_S`, or the longest in which it just did not change.

    Parameters
    ----------
    told_m : (n,) array
        Level, or what of it counts where only changes do: NaN is "no value".
    level_m : (n,) array
        As recorded: what is missing here is missing indeed.
    """
    at = np.flatnonzero(np.isfinite(told_m))
    missing_s = np.diff(np.cumsum(~np.isfinite(level_m))[at])
    return int(np.max(np.diff(at)[missing_s <= LOST_S], initial=LOST_S))


def without_s(is_known: Flags) -> Integers:
    """(n,) seconds without a value before each.

    Examples
    --------
    >>> without_s(np.array([True, False, False, True, True]))
    array([0, 0, 1, 2, 0])
    """
    place = np.arange(is_known.size)
    last = np.maximum.accumulate(np.where(is_known, place, -1))
    return np.asarray(place - np.r_[-1, last[:-1]] - 1, dtype=np.int64)


def constant_observer(level_m: Floats, most_without_s: int = LOST_S) -> Observer:
    """Observer of a level of each second under a measured inflow, which follows it with `LEVEL_TIME_S`.

    Parameters
    ----------
    level_m : (n,) array
        NaN is "no value".
    most_without_s : int
        Time without a value after which it begins anew. [s]
    """
    lost_s = without_s(np.isfinite(level_m))
    gain = np.minimum(1.0 / LEVEL_TIME_S * (lost_s + 1), MOST_FOLLOWED)
    gain = np.where(lost_s > most_without_s, BEGUN_ANEW, gain)
    return Observer(
        level_m=level_m,
        level_gain=gain,
        inflow_gain=np.zeros(level_m.size),
        sensor_gain=np.array([gain, gain]),
        deviation_m=None,
    )


def forced_observer(traces: Traces) -> Observer:
    """Observer that takes the level from the rows, along straight lines, and predicts none."""
    rows = np.flatnonzero(np.isfinite(traces.level_m))
    middle = rows - 0.5 * (traces.span_s - 1)
    place = np.arange(traces.seconds)
    return Observer(
        level_m=np.interp(place, middle, traces.level_m[rows]) if rows.size else traces.level_m,
        level_gain=np.full(traces.seconds, BEGUN_ANEW),
        inflow_gain=np.zeros(traces.seconds),
        sensor_gain=np.full((2, traces.seconds), BEGUN_ANEW),
        deviation_m=np.full(traces.seconds, np.inf),
    )


def hides_cycles(traces: Traces, station: Station) -> bool:
    """Whether the wet well can be emptied or filled between two rows, so that the level between them is unknown."""
    level_m = traces.level_m[np.isfinite(traces.level_m)]
    if traces.is_each_second or level_m.size == 0:
        return False
    low_m, high_m = np.quantile(level_m, RANGE)
    carried_m_s = float(np.max(plant_parameters(station).rated_flow_m3h)) / 3600.0 / station.sump.mean_area_m2
    return bool(traces.rate_s * carried_m_s > high_m - low_m)


def uncertain_of(traces: Traces, station: Station, metered: MeteredInflow | None, level_m: Floats) -> Uncertain:
    r"""What is uncertain of a level in rows, or of one whose inflow is not measured; how that moves is still open.

    A switch at a moment that the rows do not show may hide a volume, which is taken from the next row and held
    against nobody:

    $$P_{LL} \leftarrow P_{LL} + \sum_i (Q_i \tau_i / A)^2 / 12$$

    with τ the time within which the pump was switched: it is as likely in each second since the row before, and a
    sensor that lags has told of most of it by the next row. Q is the flow that the recording shows, or the rated one.
    Of a measured inflow, b is the error of its course; what the mean between two rows is off besides goes to L.

    Parameters
    ----------
    traces : Traces
    station : Station
    metered : MeteredInflow or None
    level_m : (n,) array
        Level of the recording, or what of it was sent where only changes are: NaN is "no value".
    """
    plant = plant_parameters(station)
    area_m2 = station.sump.mean_area_m2
    speed_m_s = plant.rated_flow_m3h / 3600.0 / area_m2
    carried_m3h = np.array([_carried_m3h(traces, i, rated) for i, rated in enumerate(plant.rated_flow_m3h)])
    open_m2 = np.sum((carried_m3h[:, None] / 3600.0 / area_m2 * traces.drives.open_s) ** 2, axis=0) / 12.0
    per_m3h = 1.0 / 3600.0 / area_m2
    uncertain = Uncertain(
        is_known=np.isfinite(level_m),
        open_m2=_since_last_row(open_m2, traces.is_row),
        noise_m2=told_noise_m(traces, station, level_m) ** 2,
        drift_m2_s3=0.0,
        waves_m2_s=0.0,
        first_m2_s2=(FIRST_SHARE * float(speed_m_s.max())) ** 2,
        metered_m2_s2=0.0,
        lost_s=max(lost_after_s(level_m, traces.level_m), 2.5 * traces.rate_s),
        least_gain=0.0,
    )
    if metered is None:
        return uncertain
    error_m2_s2 = (metered.error_m3h * per_m3h) ** 2
    return replace(
        uncertain,
        first_m2_s2=error_m2_s2,
        drift_m2_s3=error_m2_s2 * (1.0 - metered.kept**2),
        metered_m2_s2=(metered.between_m3h * per_m3h) ** 2,
        inflow_kept=metered.kept,
        least_gain=1.0 / LEVEL_TIME_S,
    )


def row_observer(level_m: Floats, process: InflowProcess, sensor: SensorParameters) -> Observer:
    """Observer of a level in rows, or of one whose inflow is not measured: Kalman's filter of level and inflow.

    Parameters
    ----------
    level_m : (n,) array
        As `uncertain_of` was given it.
    process : InflowProcess
    sensor : SensorParameters
        Of the level.
    """
    uncertain = process.at(sensor)
    gains, variance_m2 = level_filter(uncertain, sensor)
    return Observer(
        level_m=level_m,
        level_gain=gains[0],
        inflow_gain=gains[1],
        sensor_gain=gains[2:],
        deviation_m=np.sqrt(variance_m2),
        process=process,
        inflow_kept=uncertain.inflow_kept,
    )


def _since_last_row(variance_m2: Floats, is_row: Flags) -> Floats:
    """(n,) variances that stand at rows, evenly over the seconds since the row before each.

    Examples
    --------
    >>> _since_last_row(np.array([0.0, 0.0, 0.0, 6.0]), np.array([True, False, False, True]))
    array([0., 2., 2., 2.])
    """
    rows = np.flatnonzero(is_row)
    spread = np.zeros(variance_m2.size)
    spread[: rows[-1] + 1] = np.repeat(variance_m2[rows] / np.diff(rows, prepend=-1), np.diff(rows, prepend=-1))
    return spread


def _carried_m3h(traces: Traces, pump: int, rated_m3h: float) -> float:
    """Median flow of a pump that runs, as the recording shows it; the rated one where it shows none. [m³/h]."""
    running = traces.is_row & (traces.frequency_hz[pump] > 0.0)
    flow_m3h = traces.signals["flow_m3h"][pump, running] if "flow_m3h" in traces.signals else np.zeros(0)
    flow_m3h = flow_m3h[flow_m3h > 0.0]  # NaN is no flow either
    return float(np.median(flow_m3h)) if flow_m3h.size else rated_m3h


@compiled
def _leave(
    is_known: Flags,
    level_gain: Floats,
    inflow_gain: Floats,
    inflow_kept: float,
    gained_m: Floats,
    misread_m: Floats,
    left_m: Floats,
) -> None:
    """Write what an error of the balance or of the reading leaves before each value, and between values."""
    level, inflow = 0.0, 0.0
    for k in range(is_known.size):
        level += inflow + gained_m[k]
        inflow *= inflow_kept
        left_m[k] = level + misread_m[k]
        if is_known[k]:
            level -= level_gain[k] * left_m[k]
            inflow -= inflow_gain[k] * left_m[k]
