r"""Signatures: what a cause changes in the steady readings, in units of noise, unknown inflow taken out.

Readings y of flow, head and power of running pumps, of the rise of the level, and of the inflow, at each duty point:

$$s = \frac{1}{\epsilon} P\, W \left(y(\epsilon\, \text{cause}) - y(\text{none})\right), \qquad P = I - N N^+$$

W is one over the noise of a mean (of the level: of a slope), and N holds what the true inflow changes: of each point
for itself where it is metered, of each cycle otherwise. Where the level is not measured, nobody knows which of the
points with the same frequencies is which: their mean is one reading.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.protocols.quantities import PUMP_METERS, AnalogueQuantity, SensedQuantity
from wetwell.protocols.station.station_file import Sensors, Station
from wetwell.sim2real.isolability.cause import Cause, Form
from wetwell.sim2real.isolability.duty_points import DutyPoint
from wetwell.sim2real.isolability.steady import HOUR_S, SteadyValues, steady_values
from wetwell.simulator.effects.effect import Effect
from wetwell.simulator.parameters import PlantParameters

INFLOW_DRIFT = 0.05
"""By so much the inflow differs within a cycle, another time by another part, where no meter follows it. [1]"""
LEAST_NOISE = 1e-4
"""Noise of the meters at the least, in case that a station file tells none. [1, m]"""


UNSEEN = 1e-3
"""A form that changes so little is none at this station, by these signals. [noise]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Signature:
    """(rows, forms) what those forms of a cause that show themselves change, in units of noise; one at least."""

    cause: Cause
    columns: Floats


def signatures_of(
    plant: PlantParameters,
    station: Station,
    points: Sequence[DutyPoint],
    causes: Sequence[Cause],
    signals: Collection[SensedQuantity],
) -> tuple[Signature, ...]:
    """Signatures of causes by the signals that are measured; the frequency always is.

    Parameters
    ----------
    plant : PlantParameters
        Of the station, under its own effects.
    station : Station
        Its noise.
    points : sequence of DutyPoint
        At least one.
    causes : sequence of Cause
    signals : collection of quantities

    Raises
    ------
    ValueError
        If there is no duty point, or an effect does not fit the station.
    """
    if not points:
        raise ValueError("no duty point: nothing runs steadily")
    plain = steady_values(plant, points)
    reading = _reading(points, signals)
    variance = reading.of(_squares(_noise(plain, station.sensors, points, "inflow_m3h" in signals)), power=2)
    noise = np.sqrt(variance)
    basis = _basis(_nuisance(plain, points, reading) / noise[:, None])
    before = reading.of(plain)

    def column(form: Form, share: float) -> Floats:
        changed = (
            steady_values(form.modify(plant), points)
            if isinstance(form, Effect)
            else steady_values(plant, points, [form])
        )
        seen = (reading.of(changed) - before) / noise / share
        return np.asarray(seen - basis @ (basis.T @ seen))

    def signature(cause: Cause) -> Signature:
        columns = np.column_stack([column(form, cause.share) for form in cause.forms])
        is_seen = np.linalg.norm(columns, axis=0) > UNSEEN
        return Signature(cause=cause, columns=columns[:, is_seen] if is_seen.any() else columns[:, :1])

    return tuple(map(signature, causes))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reading:
    """Which values are measured: (points, groups) shares of their means, (pumps, groups) what runs, and signals."""

    shares: Floats
    is_running: Flags
    signals: frozenset[SensedQuantity]

    def of(self, values: SteadyValues, power: int = 1) -> Floats:
        """(rows,) what is measured: of running pumps, then of the station."""
        shares = self.shares**power
        parts = [(values.pumps[name] @ shares)[self.is_running] for name in PUMP_METERS if name in self.signals]
        if "level_m" in self.signals:
            parts.append(values.level_rate_m_h @ shares)
            if "inflow_m3h" in self.signals:
                parts.append(values.inflow_m3h @ shares)
        return np.concatenate(parts) if parts else np.empty(0)


def _reading(points: Sequence[DutyPoint], signals: Collection[SensedQuantity]) -> _Reading:
    frequency_hz = np.array([point.frequency_hz for point in points])
    group = np.arange(len(points))
    if "level_m" not in signals:
        frequency_hz, group = np.unique(frequency_hz, axis=0, return_inverse=True)
    is_in = (group.reshape(-1, 1) == np.arange(len(frequency_hz))).astype(np.float64)
    return _Reading(shares=is_in / is_in.sum(axis=0), is_running=frequency_hz.T > 0.0, signals=frozenset(signals))


def _squares(values: SteadyValues) -> SteadyValues:
    return SteadyValues(
        pumps={name: reading**2 for name, reading in values.pumps.items()},
        inflow_m3h=values.inflow_m3h**2,
        level_rate_m_h=values.level_rate_m_h**2,
        area_m2=values.area_m2,
    )


def _noise(values: SteadyValues, sensors: Sensors, points: Sequence[DutyPoint], has_inflow: bool) -> SteadyValues:
    """Standard deviations of means of each point's values, and of the slope of its level."""
    count = np.array([point.values for point in points], dtype=np.float64)
    visits = np.array([point.visits for point in points], dtype=np.float64)
    every_s = np.array([point.every_s for point in points])
    in_visit = np.maximum(np.array([point.stay_s for point in points]) / every_s, 2.0)
    shares: dict[AnalogueQuantity, float] = {
        "flow_m3h": sensors.flow_noise,
        "head_m": sensors.head_noise,
        "power_kw": sensors.power_noise,
    }

    def mean(reading: Floats, share: float) -> Floats:
        return np.asarray(np.maximum(share, LEAST_NOISE) * np.maximum(np.abs(reading), LEAST_NOISE) / np.sqrt(count))

    slope_m_h = math.sqrt(12.0) * max(sensors.level_noise_m, LEAST_NOISE) / (in_visit**1.5 * every_s) * HOUR_S
    drift_m_h = 0.0 if has_inflow else INFLOW_DRIFT * values.inflow_m3h / values.area_m2
    return SteadyValues(
        pumps={name: mean(values.pumps[name], share) for name, share in shares.items()},
        inflow_m3h=mean(values.inflow_m3h, sensors.inflow_noise),
        level_rate_m_h=np.hypot(slope_m_h, drift_m_h) / np.sqrt(visits),
        area_m2=values.area_m2,
    )


def _nuisance(values: SteadyValues, points: Sequence[DutyPoint], reading: _Reading) -> Floats:
    """(rows, inflows) what a cubic metre an hour more of each unknown inflow changes."""
    has_inflow = "inflow_m3h" in reading.signals
    group = np.arange(len(points)) if has_inflow else np.unique([p.cycle for p in points], return_inverse=True)[1]
    columns = []
    for one in range(int(group.max()) + 1):
        is_ours = (group == one).astype(np.float64)
        change = SteadyValues(
            pumps={name: np.zeros_like(known) for name, known in values.pumps.items()},
            inflow_m3h=is_ours,
            level_rate_m_h=is_ours / values.area_m2,
            area_m2=values.area_m2,
        )
        columns.append(reading.of(change))
    return np.column_stack(columns)


def _basis(columns: Floats) -> Floats:
    """(rows, rank) orthonormal basis of what columns span."""
    if columns.shape[0] == 0:
        return columns
    left, singular, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, singular > 1e-9 * max(float(singular.max(initial=0.0)), 1e-300)])
