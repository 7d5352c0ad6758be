"""What a station reads while nothing disturbs its sensors: by signal, regime and span of time."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.quantities import PUMP_METERS, AnalogueQuantity, pump_column
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.seconds import since_changes
from wetwell.sim2real.residuals.phases import PHASES_S
from wetwell.sim2real.truth.spec import HOUR_S, duty_m3h, rated_power_w

STANDING, RISING, RUNNING, FALLING = range(4)
_BALANCE, _START, _STOP = range(len(PUMP_METERS), len(PUMP_METERS) + 3)
_SLOPE_S = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class Readings:
    """Values of seconds, (k,) arrays.

    Attributes
    ----------
    group : array
        Number of signal, pump, regime and span of the time since the regime began, the same in all recordings.
    value : array
        In the unit of the signal; of the level what the balance of the wet well does not tell of it. [m]
    material : array
        Size under which nobody acts on a difference of this value, in its unit.
    turn : array
        How often the regime had begun, from 1.
    """

    group: Integers
    value: Floats
    material: Floats
    turn: Integers


def readings_of(recording: Recording, station: Station, absent: Collection[AnalogueQuantity] = ()) -> Readings:
    r"""Readings of a recording with a row a second and without noise.

    Flow, head and power are as they are. The level is

    $$e(t) = L(t) - L(t_0) - \frac{1}{A} \int_{t_0}^t \left(Q_\text{in} - \sum_i Q_i\right) \mathrm{d}t$$

    since the regime of the station began at $t_0$, with the area A of the station file and flows as they are
    metered: so weather that comes at another hour does not count. At a start or stop it is the level just before it.
    Material is, by `[materiality]` of the station file,

    $$m^2 = \left(s \sqrt{x^2 + \tfrac14 x_r^2}\right)^2 + (\tau \dot x)^2, \qquad
    m_e^2 = m_L^2 + \left(\frac{s_Q}{A} \int_{t_0}^t Q\,\mathrm{d}t\right)^2 + (\tau \dot L)^2$$

    with the share s, the value at the duty point $x_r$, the time τ and what passes through the wet well Q.

    Parameters
    ----------
    recording : Recording
    station : Station
        As its file says.
    absent : collection of quantities
        What is not stored: it is not read, and nothing is known of it but the inflow.
    """
    states = np.array(
        [
            _state(recording.column(pump_column(i + 1, "frequency_hz")), pump.nominal_frequency_hz)
            for i, pump in enumerate(station.pump)
        ]
    )
    materiality = station.materiality
    flow_m3h, head_m = duty_m3h(station)
    rated = {"flow_m3h": flow_m3h, "head_m": head_m, "power_kw": rated_power_w(station) / 1000.0}
    shares = {
        "flow_m3h": materiality.flow_share,
        "head_m": materiality.head_share,
        "power_kw": materiality.power_share,
    }
    parts = []
    for signal, quantity in enumerate(PUMP_METERS):
        if quantity in absent:
            continue
        for i in range(len(states)):
            value = recording.column(pump_column(i + 1, quantity))
            size = shares[quantity] * np.hypot(value, 0.5 * rated[quantity])
            material = np.hypot(size, materiality.time_s * np.gradient(value))
            others = (np.delete(states, i, axis=0) != STANDING).any(axis=0)
            parts.append(_in_spans(signal, i, 2 * states[i] + others, value, material))
    if "level_m" not in absent:
        parts += _of_level(recording, station, states, has_flow="flow_m3h" not in absent)
    group, value, material, turn = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return Readings(group=group, value=value, material=material, turn=turn)


_Part = tuple[Integers, Floats, Floats, Integers]
"""Group, value, material size and turn."""


def _state(frequency_hz: Floats, nominal_hz: float) -> Integers:
    """(n,) what a drive does: between standing and full speed it goes where it does not come from."""
    is_end = (frequency_hz <= 0.0) | (frequency_hz >= 0.999 * nominal_hz)
    last = np.maximum.accumulate(np.where(is_end, np.arange(is_end.size), 0))
    came_from = frequency_hz[last] > 0.0
    state = np.where(came_from, FALLING, RISING)
    state[is_end] = np.where(frequency_hz[is_end] > 0.0, RUNNING, STANDING)
    return state


def _of_level(recording: Recording, station: Station, states: Integers, *, has_flow: bool) -> list[_Part]:
    materiality, area_m2 = station.materiality, station.sump.mean_area_m2
    level_m, inflow_m3h = recording.column("level_m"), recording.column("inflow_m3h")
    flows = [recording.column(pump_column(i + 1, "flow_m3h")) for i in range(len(states))]
    out_m3h = np.sum(flows, axis=0) * has_flow
    regime = np.sum([np.array([0, 1, 5, 25])[state] for state in states], axis=0)
    began = np.arange(level_m.size) - since_changes(regime)
    passing_m3h = np.hypot(np.maximum(inflow_m3h, np.sum(flows, axis=0)), 0.5 * duty_m3h(station)[0])
    error_m = level_m - _summed(inflow_m3h - out_m3h) / HOUR_S / area_m2
    carried_m = _summed(passing_m3h) / HOUR_S / area_m2
    late_m = materiality.time_s * np.gradient(level_m)
    share_m = materiality.flow_share * (carried_m - carried_m[began])
    material_m = np.sqrt(materiality.level_m**2 + share_m**2 + late_m**2)
    parts = [_in_spans(_BALANCE, 0, regime, error_m - error_m[began], material_m)]
    running = ((states == RISING) | (states == RUNNING)).sum(axis=0)
    for signal, state in ((_START, RISING), (_STOP, FALLING)):
        before = np.flatnonzero(((states[:, 1:] == state) & (states[:, :-1] != state)).any(axis=0))
        before = before[before >= _SLOPE_S]
        slope_m_s = (level_m[before] - level_m[before - _SLOPE_S]) / _SLOPE_S
        group = _number(signal, 0, running[before], np.zeros_like(before))
        material_m = np.hypot(materiality.threshold_m, materiality.time_s * slope_m_s)
        parts.append((group, level_m[before], material_m, np.arange(1, before.size + 1)))
    return parts


def _summed(flow_m3h: Floats) -> Floats:
    """(n,) sums over the seconds so far, each as the mean of its ends. [m³/h s]."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (flow_m3h[1:] + flow_m3h[:-1]))])


def _in_spans(signal: int, pump: int, regime: Integers, value: Floats, material: Floats) -> _Part:
    since = since_changes(regime)
    turn = np.zeros(regime.size, dtype=np.int64)
    for one in np.unique(regime):
        turn = np.where(regime == one, np.cumsum((since == 0) & (regime == one)), turn)
    return _number(signal, pump, regime, np.searchsorted(PHASES_S, since)), value, material, turn


def _number(signal: int, pump: int, regime: Integers, span: Integers) -> Integers:
    return ((signal * 64 + pump) * 512 + regime) * 64 + span
