"""Validation of a station file: the simulator runs free under the measured inflow, beside the recording."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.quantities import pump_column
from wetwell.protocols.recordings.kpi import kpis
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S, to_iso
from wetwell.sim2real.recording.checks import check_pumps
from wetwell.sim2real.recording.inflow import infer_inflow_m3h
from wetwell.sim2real.recording.seconds import trailing_means
from wetwell.simulator.inflow.recorded import RecordedInflow
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

MIN_KNOWN_SHARE = 0.5
RUNNING = ("running", "frequency_hz")
"""Quantities of a pump that show whether it runs."""
DAY_S = 86_400
"""Seconds that are simulated at a time: memory goes by it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """Simulated against measured, closed loop, as the paper compares them.

    Attributes
    ----------
    inflow : str
        "measured" or "inferred".
    level_nmae : float
        Mean absolute difference of the levels over the range of the measured one. Range >= 0; best 0. [1]
    days : tuple of str
        Days in UTC that the recording touches.
    starts, run_h : (2, days, pumps) arrays
        Measured and simulated starts and run time of each pump on each day. [1, h]
    """

    inflow: str
    level_nmae: float
    days: tuple[str, ...]
    starts: Integers
    run_h: Floats

    @property
    def starts_nmae(self) -> Floats:
        """(pumps,) sum over the days of the absolute difference of starts, over the sum of the measured ones."""
        return _normalised(self.starts.astype(np.float64))

    @property
    def run_h_nmae(self) -> Floats:
        """(pumps,) the same of the run time."""
        return _normalised(self.run_h)


def validate(recording: Recording, station: Station, *, seed: int = 0) -> tuple[Validation, Recording]:
    """Comparison, and the simulated recording on the rows of the measured one: means where it holds means.

    The inflow is the measured one where at least half of it is there, else inferred from level and flow. Values
    between known ones are held; a mean holds in the interval that ends at its stamp.

    Parameters
    ----------
    recording : Recording
        Prepared: times rise.
    station : Station
    seed : int
        Of the simulated sensors' noise.

    Raises
    ------
    ValueError
        If the numbers of pumps differ, no levels drive the station, or level or inflow are neither measured nor can
        be inferred.
    """
    simulated, source = _free_run(recording, station, lambda _: True, seed)
    return _compared(recording, simulated, source), simulated


def validation_of(recording: Recording, station: Station, *, seed: int = 0) -> Validation:
    """The comparison of `validate` alone: of a long simulation only what is compared is kept."""
    compared = {"level_m", *(pump_column(i, name) for i in range(1, len(station.pump) + 1) for name in RUNNING)}
    simulated, source = _free_run(recording, station, compared.__contains__, seed)
    return _compared(recording, simulated, source)


def _free_run(
    recording: Recording, station: Station, is_kept: Callable[[str], bool], seed: int
) -> tuple[Recording, str]:
    """Simulated recording with the columns that are kept, and where its inflow is from."""
    if station.control.is_external:
        raise ValueError(f"station '{station.name}': control.mode 'external': no levels start pumps")
    check_pumps(recording, station)
    level_m = recording.column("level_m")
    if not np.isfinite(level_m).any():
        raise ValueError("column 'level_m' has no values: nothing to hold the simulator against")
    inflow_m3h, source = recording.column("inflow_m3h"), "measured"
    if np.isfinite(inflow_m3h).mean() < MIN_KNOWN_SHARE:
        inflow_m3h, source = infer_inflow_m3h(recording, station), "inferred"
    known = np.flatnonzero(np.isfinite(inflow_m3h))
    if known.size == 0:
        raise ValueError("the inflow is neither measured nor can it be inferred")
    time_s = (recording.time_ns - recording.time_ns[0]) / NS_PER_S
    span_s = (
        max(round(float(np.median(np.diff(time_s)))), 1) if recording.value == "mean" and len(recording) > 1 else 1
    )
    seconds = int(time_s[-1]) + span_s
    scenario = Scenario(
        name="validation",
        initial_level_m=max(float(level_m[np.isfinite(level_m)][0]), 0.0),
        inflow=RecordedInflow(
            time_s=np.concatenate([[0.0], time_s[known][time_s[known] > 0.0]]),
            flow_m3h=np.maximum(inflow_m3h[np.concatenate([known[:1], known[time_s[known] > 0.0]])], 0.0),
        ),
    )
    simulation = Simulation(station, scenario, seed, int(recording.time_ns[0]) - (span_s - 1) * NS_PER_S)
    columns: dict[str, list[Floats]] = {}
    for begin in range(0, seconds, DAY_S):
        block = simulation.advance(min(DAY_S, seconds - begin), truth=False)
        for name, values in block.columns.items():
            if is_kept(name):
                columns.setdefault(name, []).append(values)
    rows = np.minimum(time_s.astype(np.int64) + span_s - 1, seconds - 1)
    return (
        Recording(
            time_ns=recording.time_ns,
            columns={name: trailing_means(np.concatenate(blocks), span_s)[rows] for name, blocks in columns.items()},
            station=station.name,
            value=recording.value,
        ),
        source,
    )


def _compared(recording: Recording, simulated: Recording, source: str) -> Validation:
    level_m = recording.column("level_m")
    known_level = np.isfinite(level_m)
    spread_m = float(np.ptp(level_m[known_level]))
    error_m = np.abs(simulated.column("level_m") - level_m)[known_level]
    measured_figures, simulated_figures = (kpis(_running_of(one, recording.pumps)) for one in (recording, simulated))
    return Validation(
        inflow=source,
        level_nmae=float(error_m.mean()) / spread_m if spread_m > 0.0 else float("nan"),
        days=tuple(to_iso(int(day_ns))[:10] for day_ns in measured_figures.day_ns),
        starts=np.array([measured_figures.daily_starts.T, simulated_figures.daily_starts.T]),
        run_h=np.array([measured_figures.daily_run_h.T, simulated_figures.daily_run_h.T]),
    )


def _running_of(recording: Recording, pumps: int) -> Recording:
    """What shows that pumps run: sums of flow and power take long, and are not compared."""
    names = [pump_column(i, name) for i in range(1, pumps + 1) for name in RUNNING]
    return replace(recording, columns={name: recording.column(name) for name in names}, truth={})


def _normalised(figures: Floats) -> Floats:
    """(pumps,) error of (2, days, pumps) measured and simulated figures; NaN where nothing was measured."""
    measured = figures[0].sum(axis=0)
    error = np.abs(figures[1] - figures[0]).sum(axis=0)
    return np.asarray(np.where(measured > 0.0, error / np.where(measured > 0.0, measured, 1.0), np.nan))
