"""What the datasheet says of a station: the curves from which residuals are taken."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from wetwell.protocols.station import Station


@dataclass(frozen=True, slots=True, kw_only=True)
class Nominal:
    """Datasheet curves of a station.

    Attributes
    ----------
    curves : tuple of (c0, c1, c2), one a pump
        H = c0 N² + c1 N Q + c2 Q², Q in m³/h.
    frequencies_hz : tuple of float
        Nominal frequency of each pump. [Hz]
    static_head_m, friction_h2_m5 : float
        H = H_s + k Q². [m, h²/m⁵]
    is_common_header : bool
        Whether k acts on the total flow.
    area_m2 : float
        Cross-section of the wet well. [m²]
    """

    curves: tuple[tuple[float, float, float], ...]
    frequencies_hz: tuple[float, ...]
    static_head_m: float
    friction_h2_m5: float
    is_common_header: bool
    area_m2: float

    @property
    def pumps(self) -> int:
        """Number of pumps."""
        return len(self.curves)

    def runout_flow_m3h(self, pump: int) -> float:
        """Flow at which the curve of a pump (from 0) reaches zero head at nominal speed. [m³/h]."""
        c0, c1, c2 = self.curves[pump]
        return 2.0 * c0 / (-c1 + math.sqrt(c1 * c1 - 4.0 * c2 * c0))

    def duty_flows(self, speed_ratios: Sequence[float]) -> list[float]:
        """Flow of each pump on its curve and that of the main, at these speeds; 0 where it stands or cannot lift.

        On a common header the head is found by bisection, to a thousandth of a millimetre of water. [m³/h].
        """
        on_own = [self._own_flow_m3h(pump, speed) for pump, speed in enumerate(speed_ratios)]
        if not self.is_common_header or sum(flow > 0.0 for flow in on_own) < 2:
            return on_own
        low_m = self.static_head_m
        high_m = max(curve[0] * speed**2 for curve, speed in zip(self.curves, speed_ratios, strict=True))
        while high_m - low_m > 1e-6:
            head_m = 0.5 * (low_m + high_m)
            total_m3h = sum(self._flow_at_head_m3h(pump, speed, head_m) for pump, speed in enumerate(speed_ratios))
            if self.static_head_m + self.friction_h2_m5 * total_m3h**2 > head_m:
                low_m = head_m
            else:
                high_m = head_m
        return [self._flow_at_head_m3h(pump, speed, low_m) for pump, speed in enumerate(speed_ratios)]

    def _own_flow_m3h(self, pump: int, speed: float) -> float:
        c0, c1, c2 = self.curves[pump]
        return _flow_m3h(c0 * speed**2 - self.static_head_m, c1 * speed, c2 - self.friction_h2_m5)

    def _flow_at_head_m3h(self, pump: int, speed: float, head_m: float) -> float:
        c0, c1, c2 = self.curves[pump]
        return _flow_m3h(c0 * speed**2 - head_m, c1 * speed, c2)


def _flow_m3h(lift_m: float, linear: float, square: float) -> float:
    """Positive root of lift + linear Q + square Q², 0 without lift; square < 0 or linear < 0."""
    if lift_m <= 0.0:
        return 0.0
    return 2.0 * lift_m / (-linear + math.sqrt(linear * linear - 4.0 * square * lift_m))


def nominal_of(station: Station) -> Nominal:
    """Datasheet curves in a station file."""
    return Nominal(
        curves=tuple(pump.coefficients for pump in station.pump),
        frequencies_hz=tuple(pump.nominal_frequency_hz for pump in station.pump),
        static_head_m=station.rising_main.static_head_m,
        friction_h2_m5=station.rising_main.friction_h2_m5,
        is_common_header=station.rising_main.layout == "common",
        area_m2=station.sump.area_m2,
    )
