"""What acts and omissions cost the owner of a station."""

from typing import Annotated

from pydantic import Field

from wetwell.protocols.station.table import NonNegative, Table


class Costs(Table):
    """What acts and omissions cost, in one currency.

    Attributes
    ----------
    pull_pump, flush_main, check_meter : float
        What a visit for it costs, a crew and its work.
    call_out : float
        An unplanned call-out, if a fault is left until the station fails.
    failure_share : float
        Probability that a fault which is left fails before the next planned visit.
    energy_per_kwh : float
        Price of a kilowatt-hour, to price what a fault wastes.
    crew_per_hour : float
        An hour of one who works at the station or at its screens.
    horizon_days : float
        Until the next planned visit.
    """

    pull_pump: NonNegative = 600.0
    flush_main: NonNegative = 900.0
    check_meter: NonNegative = 150.0
    call_out: NonNegative = 2500.0
    failure_share: Annotated[float, Field(ge=0, le=1)] = 0.5
    energy_per_kwh: NonNegative = 0.25
    crew_per_hour: NonNegative = 75.0
    horizon_days: NonNegative = 14.0
