"""What the datasheet says of a station: the curves from which residuals are taken."""

import math
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
    """

    curves: tuple[tuple[float, float, float], ...]
    frequencies_hz: tuple[float, ...]
    static_head_m: float
    friction_h2_m5: float
    is_common_header: bool

    @property
    def pumps(self) -> int:
        """Number of pumps."""
        return len(self.curves)

    def runout_flow_m3h(self, pump: int) -> float:
        """Flow at which the curve of a pump (from 0) reaches zero head at nominal speed. [m³/h]."""
        c0, c1, c2 = self.curves[pump]
        return 2.0 * c0 / (-c1 + math.sqrt(c1 * c1 - 4.0 * c2 * c0))


def nominal_of(station: Station) -> Nominal:
    """Datasheet curves in a station file."""
    return Nominal(
        curves=tuple(pump.coefficients for pump in station.pump),
        frequencies_hz=tuple(pump.nominal_frequency_hz for pump in station.pump),
        static_head_m=station.rising_main.static_head_m,
        friction_h2_m5=station.rising_main.friction_h2_m5,
        is_common_header=station.rising_main.layout == "common",
    )
