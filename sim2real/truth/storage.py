"""What a historian keeps of a recording: a row in some seconds, means or held values, rounded, not of all signals."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.quantities import HAND_COLUMNS, AnalogueQuantity, quantity_of
from wetwell.protocols.recordings.origin import StoredValue
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.truth.parts import rounded
from wetwell.sim2real.truth.spec import duty_m3h, rated_power_w
from wetwell.sim2real.truth.telemetry import by_exception

ROUNDED_SHARE = 0.5
"""Share of the stations whose historian rounds so that one can see it. [1]"""
LEVEL_STEPS_M = (0.001, 0.01)
FLOW_STEPS_M3H = (0.1, 0.5, 1.0)
FREQUENCY_STEPS_HZ = (0.01, 0.1)
HEAD_STEP_M = 0.01
POWER_STEP_KW = 0.1
"""What a historian that rounds rounds to, in the unit of the name; where there are several a case draws one."""
DEADBANDS = (0.0025, 0.02)
"""Least and largest deadband of flow, head and power, as a share of the duty. [1]"""
LEVEL_DEADBANDS_M = (0.002, 0.02)
FREQUENCY_DEADBANDS_HZ = (0.02, 0.2)
"""Least and largest deadband of the level and of frequencies."""
REPORTS_S = (60.0, 900.0)
"""Shortest and longest age at which a value that is still within its deadband is stored again. [s]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Storage:
    """How a historian stores what arrives each second; as it stands nothing is lost.

    Attributes
    ----------
    every_s : int
        Seconds from row to row. [s]
    value : "instant", "mean" or "held"
        What a row holds: the value at its stamp; the mean of the seconds since the row before; the value that was
        stored last, when it had moved by its deadband or its age was `report_s`.
    absent : tuple of quantities
        Signals that the station has no meter for, or that are not stored.
    step : mapping of quantity to float
        What stored values are whole multiples of, in the unit of the quantity.
    deadband : mapping of quantity to float
        In the unit of the quantity; of held values.
    report_s : float
        [s]
    """

    every_s: int = 1
    value: StoredValue = "instant"
    absent: tuple[AnalogueQuantity, ...] = ()
    step: Mapping[AnalogueQuantity, float] = field(default_factory=dict)
    deadband: Mapping[AnalogueQuantity, float] = field(default_factory=dict)
    report_s: float = np.inf

    @property
    def inherent(self) -> tuple[str, ...]:
        """Effects of the library that such storage is, to some degree; steps of a centimetre are none."""
        return ("report_by_exception",) if self.value == "held" else ()


EVERY_SECOND = Storage()
"""All that arrives, as it arrives."""


def stored(recording: Recording, storage: Storage) -> Recording:
    """What is stored of a recording with a row a second; a running flag has no mean and is then left out.

    Parameters
    ----------
    recording : Recording
        With a row a second.
    storage : Storage

    Examples
    --------
    >>> rows = Recording(time_ns=np.arange(5), columns={"level_m": np.array([0.0, 1.0, 2.0, 3.0, 5.04])})
    >>> stored(rows, Storage(every_s=2, value="mean", step={"level_m": 0.1})).columns["level_m"]
    array([1.5, 4. ])
    """
    kept: dict[str, Floats] = {}
    for name, values in recording.columns.items():
        quantity = quantity_of(name)
        if name in HAND_COLUMNS:
            kept[name] = _rows(values, storage)
            continue
        if quantity is None or quantity in storage.absent:
            continue
        if quantity == "running":
            if storage.value != "mean":
                kept[name] = _rows(values, storage)
            continue
        is_held = storage.value == "held"
        sent = by_exception(values, storage.deadband.get(quantity, 0.0), storage.report_s) if is_held else values
        step = storage.step.get(quantity, 0.0)
        rows = _rows(sent, storage)
        kept[name] = np.round(np.round(rows / step) * step, 9) if step > 0.0 else rows
    stamps = _stamps(len(recording), storage)
    truth = {name: values[stamps] for name, values in recording.truth.items()}
    return replace(recording, time_ns=recording.time_ns[stamps], columns=kept, truth=truth, value=storage.value)


def _stamps(seconds: int, storage: Storage) -> Integers:
    """Seconds at which a row is stored; the first mean needs a whole interval."""
    first = storage.every_s if storage.value == "mean" and storage.every_s > 1 else 0
    return np.arange(first, seconds, storage.every_s)


def _rows(values: Floats, storage: Storage) -> Floats:
    rows = _stamps(values.size, storage)
    if storage.value != "mean" or storage.every_s == 1:
        return values[rows]
    since = values[1 : 1 + rows.size * storage.every_s].reshape(rows.size, storage.every_s)
    known = np.isfinite(since)
    count = known.sum(axis=1)
    total = np.where(known, since, 0.0).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def storage_of(
    station: Station,
    rng: np.random.Generator,
    *,
    every_s: int = 1,
    value: StoredValue = "instant",
    absent: tuple[AnalogueQuantity, ...] = (),
) -> Storage:
    """A historian at random: half of them round to what telemetry usually shows; held values have deadbands.

    Parameters
    ----------
    station : Station
    rng : numpy.random.Generator
    every_s : int
        [s]
    value : "instant", "mean" or "held"
    absent : tuple of quantities
    """
    flow_m3h, head_m = duty_m3h(station)
    flow_step_m3h = float(rng.choice(FLOW_STEPS_M3H))
    step: dict[AnalogueQuantity, float] = {
        "level_m": float(rng.choice(LEVEL_STEPS_M)),
        "inflow_m3h": flow_step_m3h,
        "frequency_hz": float(rng.choice(FREQUENCY_STEPS_HZ)),
        "flow_m3h": flow_step_m3h,
        "head_m": HEAD_STEP_M,
        "power_kw": POWER_STEP_KW,
    }
    deadband: dict[AnalogueQuantity, float] = {
        "level_m": _over(LEVEL_DEADBANDS_M, rng),
        "inflow_m3h": flow_m3h * _over(DEADBANDS, rng),
        "frequency_hz": _over(FREQUENCY_DEADBANDS_HZ, rng),
        "flow_m3h": flow_m3h * _over(DEADBANDS, rng),
        "head_m": head_m * _over(DEADBANDS, rng),
        "power_kw": rated_power_w(station) / 1000.0 * _over(DEADBANDS, rng),
    }
    report_s = _over(REPORTS_S, rng)
    return Storage(
        every_s=every_s,
        value=value,
        absent=absent,
        step=step if rng.random() < ROUNDED_SHARE else {},
        deadband={quantity: rounded(size) for quantity, size in deadband.items()} if value == "held" else {},
        report_s=float(round(report_s)) if value == "held" else np.inf,
    )


def _over(limits: tuple[float, float], rng: np.random.Generator) -> float:
    """Even in the logarithm."""
    return float(np.exp(rng.uniform(*np.log(limits))))
