"""A station file held against a recording, row by row at the recorded speeds and level: no error is carried on."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.protocols.quantities import PUMP_METERS, AnalogueQuantity
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.calibration.fit.power_fit import PowerLines
from wetwell.sim2real.calibration.steady import RAMP_STEP, Running, running_of
from wetwell.sim2real.recording.checks import check_pumps, check_rising
from wetwell.simulator.duty import duty_flows_m3h
from wetwell.simulator.effects import effective_parameters
from wetwell.simulator.parameters import PlantParameters
from wetwell.simulator.power import INRUSH_LIMIT
from wetwell.simulator.telemetry.channels import channels_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Errors of one quantity of one pump or main: median absolute, mean square root, and median with its sign.

    In steady rows they are relative to the measured value; over all rows, standing ones included where something was
    told, relative to the median of what was measured while it ran. NaN without rows.

    Attributes
    ----------
    what : str
        Name of the pump or main.
    quantity : str
        "flow_m3h", "head_m" or "power_kw".
    steady_rows, rows : int
    steady_median, steady_rms, steady_bias : float
        [1]
    median, rms, bias : float
        Over all rows. [1]
    """

    what: str
    quantity: str
    steady_rows: int
    steady_median: float
    steady_rms: float
    steady_bias: float
    rows: int
    median: float
    rms: float
    bias: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Measured values beside those of a station at the recorded speeds and level, signals (pumps, n); NaN: not told.

    Attributes
    ----------
    measured, told : dict of (pumps, n) arrays
    is_steady : (pumps, n) bool array
        Whether a pump runs and nothing is switched on its main.
    mains : tuple of (name, pumps from 0)
    names : tuple of str
        Of the pumps.
    """

    measured: dict[AnalogueQuantity, Floats]
    told: dict[AnalogueQuantity, Floats]
    is_steady: Flags
    mains: tuple[tuple[str, tuple[int, ...]], ...]
    names: tuple[str, ...]

    def errors(self, quantity: AnalogueQuantity) -> list[Errors]:
        """Errors of a quantity of all pumps, of each, and where it adds up, of each main with several pumps."""
        told, measured = self.told[quantity], self.measured[quantity]
        rows = [_errors("all pumps", quantity, told.ravel(), measured.ravel(), self.is_steady.ravel())]
        rows += [
            _errors(f"pump {name}", quantity, told[i], measured[i], self.is_steady[i])
            for i, name in enumerate(self.names)
        ]
        for name, members in self.mains:
            if quantity == "head_m" or len(members) < 2:
                continue
            several = list(members)
            steady: Flags = np.any(self.is_steady[several], axis=0)
            rows.append(_errors(name, quantity, told[several].sum(axis=0), measured[several].sum(axis=0), steady))
        return rows

    def steady_errors(self, quantity: AnalogueQuantity) -> Floats:
        """(n,) relative errors of all steady values of all pumps. [1]."""
        usable = self.is_steady & (self.measured[quantity] > 0.0) & np.isfinite(self.told[quantity])
        relative: Floats = self.told[quantity][usable] / self.measured[quantity][usable] - 1.0
        return relative


def compare(recording: Recording, station: Station) -> Comparison:
    """Flow, head and power that a station gives at the recorded speeds and levels, beside the measured ones.

    A mean over an interval in which a pump was switched is taken as that share of the interval for which its mean
    frequency stands beside that of its next steady row. Effects of the station file count as far as they change
    curves, mains, power or meters; what comes and goes (air, rags, slip, damping) is left out.

    Parameters
    ----------
    recording : Recording
        Prepared: times rise.
    station : Station

    Raises
    ------
    ValueError
        If the numbers of pumps differ, times do not rise, or an effect does not fit the station.
    """
    check_pumps(recording, station)
    check_rising(recording)
    parameters = effective_parameters(station)
    running = running_of(recording, station)
    main_of_pump = np.array(station.main_of_pump)
    speed = np.nan_to_num(running.speed_ratio)
    share = np.ones_like(speed)
    steady = np.zeros(speed.shape, dtype=bool)
    for main in range(len(station.mains)):
        members = main_of_pump == main
        steady[members] = running.is_steady(members) & running.running[members]
    if recording.value == "mean":
        speed, share = _shares(speed, steady, running)
    level_m = recording.column("level_m")
    signals = _signals(parameters, speed, level_m)
    pumps = len(station.pump)
    told: dict[AnalogueQuantity, Floats] = {}
    for quantity in PUMP_METERS:
        sensors = [parameters.sensors[channel] for channel in channels_of(quantity, pumps)]
        gain = np.array([[sensor.gain] for sensor in sensors])
        offset = np.array([[sensor.offset] for sensor in sensors])
        told[quantity] = share * np.where(speed > 0.0, gain * signals[quantity] + offset, 0.0)
    measured: dict[AnalogueQuantity, Floats] = {
        quantity: recording.of_pumps(quantity, pumps) for quantity in PUMP_METERS
    }
    names = [main.name or "rising main" for main in station.mains]
    return Comparison(
        measured=measured,
        told=told,
        is_steady=steady,
        mains=tuple((name, tuple(np.flatnonzero(main_of_pump == m).tolist())) for m, name in enumerate(names)),
        names=station.pump_labels,
    )


def _shares(speed: Floats, steady: Flags, running: Running) -> tuple[Floats, Floats]:
    """Speeds while running and shares of the interval, of means in which pumps were switched."""
    whole, share = speed.copy(), np.ones_like(speed)
    for i, own in enumerate(speed):
        known = np.flatnonzero(steady[i])
        if known.size == 0:
            continue
        rows = np.arange(own.size)
        after = known[np.minimum(np.searchsorted(known, rows), known.size - 1)]
        before = known[np.maximum(np.searchsorted(known, rows, side="right") - 1, 0)]
        same_after = running.run[i][after] == running.run[i]
        beside = np.where(same_after, own[after], own[before])
        is_part = running.running[i] & (own < beside * (1.0 - RAMP_STEP)) & ~steady[i]
        share[i] = np.where(is_part, own / np.where(beside > 0.0, beside, 1.0), 1.0)
        whole[i] = np.where(is_part, beside, own)
    return whole, share


def _signals(parameters: PlantParameters, speed: Floats, level_m: Floats) -> dict[AnalogueQuantity, Floats]:
    """(pumps, n) flow, head and power at speeds and levels; NaN where a level is needed and missing."""
    flow_m3h = duty_flows_m3h(parameters, speed.T, level_m).T
    c0, c1, c2 = parameters.curves.T[:, :, None]
    head_m = c0 * speed**2 + c1 * speed * flow_m3h + c2 * flow_m3h**2
    return {"flow_m3h": flow_m3h, "head_m": head_m, "power_kw": _power_kw(parameters, speed, flow_m3h)}


def _power_kw(parameters: PlantParameters, speed: Floats, flow_m3h: Floats) -> Floats:
    """(pumps, n) input power, by frequency and load as the plant has it."""
    full_kw = np.sqrt(3.0) * parameters.voltage_v * parameters.rated_current_a * parameters.power_factor / 1000.0
    power_kw: Floats = (1.0 - parameters.load_share) * full_kw * np.minimum(speed, INRUSH_LIMIT)
    if parameters.load_share > 0.0:
        lines = PowerLines(
            rated_flow_m3h=np.array([pump.rated_flow_m3h for pump in parameters.pumps]),
            rated_shaft_kw=np.array([pump.rated_shaft_kw for pump in parameters.pumps]),
            shutoff_share=np.array([pump.shutoff_power_share for pump in parameters.pumps]),
            efficiency=parameters.motor_efficiency * parameters.drive_efficiency,
            losses_share=parameters.losses_share,
        )
        for i, own in enumerate(speed):
            turning = own > 0.0
            rows = np.full(int(turning.sum()), i)
            power_kw[i, turning] += (
                parameters.load_share * (lines.design(rows, own[turning], flow_m3h[i, turning])[:, i])
            )
    return power_kw


def _errors(what: str, quantity: str, told: Floats, measured: Floats, steady: Flags) -> Errors:
    known = np.isfinite(told + measured)
    some = steady & known & (measured > 0.0)
    relative = told[some] / measured[some] - 1.0
    ran = known & (measured > 0.0)
    size = float(np.median(measured[ran])) if ran.any() else np.nan
    every = (told[known] - measured[known]) / size
    return Errors(
        what=what,
        quantity=quantity,
        steady_rows=int(some.sum()),
        steady_median=_median(np.abs(relative)),
        steady_rms=_rms(relative),
        steady_bias=_median(relative),
        rows=int(known.sum()),
        median=_median(np.abs(every)),
        rms=_rms(every),
        bias=_median(every),
    )


def _median(values: Floats) -> float:
    return float(np.median(values)) if values.size else float("nan")


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size and np.isfinite(values).all() else float("nan")
