"""A rising main of a station file."""

from typing import Literal

from wetwell.protocols.station.table import NonNegative, Table


class RisingMain(Table):
    """System curve H = static_head_m + friction_h2_m5 Q², Q in m³/h."""

    static_head_m: NonNegative = 2.0
    friction_h2_m5: NonNegative = 6.0e-4
    layout: Literal["individual", "common"] = "individual"
