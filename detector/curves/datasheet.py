"""What the datasheet says of a station: the curves from which residuals are taken."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wetwell.protocols.arrays import Records
from wetwell.protocols.jit import compiled
from wetwell.protocols.station.station_file import Station

Curve = tuple[float, float, float]
"""(c0, c1, c2) of the pump curve at nominal speed, Q in m³/h."""
TABLE = np.dtype(
    [
        (name, np.float64)
        for name in (
            "c0",
            "c1",
            "c2",
            "frequency_hz",
            "runout_m3h",
            "static_head_m",
            "level_slope",
            "friction_h2_m5",
        )
    ]
    + [("is_common_header", np.int64), ("main", np.int64)]
)
"""Of each pump; `main` is the place of the first pump on the same main."""
RESOLUTION_M = 1e-9
"""The head of a common header is found to this."""
MAX_STEPS = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class SystemCurve:
    """Datasheet curve of a rising main.

    Attributes
    ----------
    static_head_m, friction_h2_m5 : float
        H = H_s + k Q², with the wet well at level 0. [m, h²/m⁵]
    level_slope : float
        Static head that a metre of level takes away: 1 where the main lifts to a delivery level. [1]
    is_common_header : bool
        Whether k acts on the total flow of its pumps.
    name : str, optional
        What people call it.
    """

    static_head_m: float
    friction_h2_m5: float
    is_common_header: bool
    level_slope: float = 0.0
    name: str | None = field(default=None, repr=False, compare=False)

    def static_head_at_m(self, level_m: float) -> float:
        """Static head with the wet well at a level. [m]."""
        return self.static_head_m - self.level_slope * level_m if self.level_slope else self.static_head_m


@dataclass(frozen=True, slots=True, kw_only=True)
class Datasheet:
    """Datasheet curves of a station.

    Attributes
    ----------
    curves : tuple of (c0, c1, c2), one a pump
        H = c0 N² + c1 N Q + c2 Q², Q in m³/h.
    frequencies_hz : tuple of float
        Nominal frequency of each pump. [Hz]
    mains : tuple of SystemCurve
    main_of_pump : tuple of int
        Place of each pump's main in `mains`.
    area_m2 : float
        Cross-section of the wet well. [m²]
    middle_level_m : float
        Level at which a curve is drawn where no other is known. [m]
    floor_level_m : float
        Level at which the wet well is empty. [m]
    """

    curves: tuple[Curve, ...]
    frequencies_hz: tuple[float, ...]
    mains: tuple[SystemCurve, ...]
    main_of_pump: tuple[int, ...]
    area_m2: float
    middle_level_m: float
    floor_level_m: float = 0.0

    @property
    def pumps(self) -> int:
        """Number of pumps."""
        return len(self.curves)

    def main_of(self, pump: int) -> SystemCurve:
        """Main of a pump (from 0)."""
        return self.mains[self.main_of_pump[pump]]

    def runout_flow_m3h(self, pump: int) -> float:
        """Flow at which the curve of a pump (from 0) reaches zero head at nominal speed. [m³/h]."""
        c0, c1, c2 = self.curves[pump]
        return 2.0 * c0 / (-c1 + math.sqrt(c1 * c1 - 4.0 * c2 * c0))

    def table(self) -> Records:
        """One record a pump, as compiled code reads the datasheet."""
        rows = []
        for pump, (curve, frequency_hz) in enumerate(zip(self.curves, self.frequencies_hz, strict=True)):
            main, first = self.main_of(pump), self.main_of_pump.index(self.main_of_pump[pump])
            lift = (main.static_head_m, main.level_slope, main.friction_h2_m5)
            rows.append((*curve, frequency_hz, self.runout_flow_m3h(pump), *lift, main.is_common_header, first))
        return np.array(rows, dtype=TABLE)


@compiled
def _flow_m3h(lift_m: float, linear: float, square: float) -> float:
    """Positive root of lift + linear Q + square Q², 0 without lift; square < 0 or linear < 0."""
    if lift_m <= 0.0:
        return 0.0
    return 2.0 * lift_m / (-linear + math.sqrt(linear * linear - 4.0 * square * lift_m))


@compiled
def static_head_at_m(own: Any, level_m: float) -> float:
    """Static head of the main of a pump in the table, with the wet well at a level. [m]."""
    static_head_m: float = own["static_head_m"]
    if own["level_slope"] > 0.0:  # else the level may be missing
        static_head_m -= own["level_slope"] * level_m
    return static_head_m


@compiled
def duty_flows(table: Any, duty: Any, level_m: float) -> None:
    """Set the flow of each pump on its curve and that of its main, at its speed; 0 where it stands or cannot lift.

    Parameters
    ----------
    table : Datasheet.table()
    duty : (pumps,) records
        `duty_speed` is read, a share of nominal; `duty_m3h` is set. [m³/h]
    level_m : float
        In the wet well; may be NaN where no main lifts to a delivery level. [m]
    """
    for first in range(table.shape[0]):
        if table[first]["main"] == first:
            _duty_flows_of(table, duty, first, static_head_at_m(table[first], level_m))


@compiled
def _duty_flows_of(table: Any, duty: Any, first: int, static_m: float) -> None:
    """Set the flows of one main, by its first pump.

    On a common header the head H where all curves meet is the root of H_s + k (sum of Q_i(H))² - H, by Newton's
    method kept between the heads at which the sum is too large and too small.
    """
    friction = table[first]["friction_h2_m5"]
    lifting, high_m = 0, static_m
    for pump in range(first, table.shape[0]):
        if table[pump]["main"] != first:
            continue
        own, speed = table[pump], duty[pump]["duty_speed"]
        shutoff_m = own["c0"] * speed * speed
        flow_m3h = _flow_m3h(shutoff_m - static_m, own["c1"] * speed, own["c2"] - friction)
        duty[pump]["duty_m3h"] = flow_m3h
        lifting += flow_m3h > 0.0
        high_m = max(high_m, shutoff_m)
    if not table[first]["is_common_header"] or lifting < 2:
        return
    low_m, head_m = static_m, static_m
    for _ in range(MAX_STEPS):
        total_m3h, slope = _flows_at_head(table, duty, first, head_m)
        lacking_m = static_m + friction * total_m3h * total_m3h - head_m
        if lacking_m > 0.0:
            low_m = head_m
        else:
            high_m = head_m
        step_m = lacking_m / (1.0 - 2.0 * friction * total_m3h * slope)
        if abs(step_m) <= RESOLUTION_M:
            return
        head_m += step_m
        if not low_m < head_m < high_m:
            head_m = 0.5 * (low_m + high_m)


@compiled
def _flows_at_head(table: Any, duty: Any, first: int, head_m: float) -> tuple[float, float]:
    """Set the flows of one main at a head of its header; their sum and that of their slopes over the head."""
    total_m3h, slope = 0.0, 0.0
    for pump in range(first, table.shape[0]):
        if table[pump]["main"] != first:
            continue
        own, speed = table[pump], duty[pump]["duty_speed"]
        linear = own["c1"] * speed
        flow_m3h = _flow_m3h(own["c0"] * speed * speed - head_m, linear, own["c2"])
        duty[pump]["duty_m3h"] = flow_m3h
        total_m3h += flow_m3h
        if flow_m3h > 0.0:
            slope += 1.0 / (linear + 2.0 * own["c2"] * flow_m3h)
    return total_m3h, slope


def datasheet_of(station: Station) -> Datasheet:
    """Datasheet curves in a station file."""
    return Datasheet(
        curves=tuple(pump.coefficients for pump in station.pump),
        frequencies_hz=tuple(pump.nominal_frequency_hz for pump in station.pump),
        mains=tuple(
            SystemCurve(
                static_head_m=main.lift_at_zero_m,
                friction_h2_m5=main.friction_h2_m5,
                is_common_header=main.layout == "common",
                level_slope=main.level_slope,
                name=main.name,
            )
            for main in station.mains
        ),
        main_of_pump=station.main_of_pump,
        area_m2=station.sump.mean_area_m2,
        middle_level_m=station.middle_level_m,
        floor_level_m=station.sump.floor_level_m,
    )
