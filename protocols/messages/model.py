"""What the detector believes of a station: curves as configured and as learnt."""

from typing import Literal

from pydantic import Field

from wetwell.protocols.messages.message import Message, Number, Stamp


class Curve(Message):
    """Head over flow at nominal frequency, with the 95 % band of the healthy pump or main.

    Parameters
    ----------
    flow_m3h : list of float
        Of each point.
    head_m : list of float
        At each flow.
    low_m, high_m : list of float
        Lower and upper end of the band at each flow; empty without a band.
    """

    flow_m3h: tuple[float, ...]
    head_m: tuple[Number, ...]
    low_m: tuple[Number, ...] = ()
    high_m: tuple[Number, ...] = ()


class PumpModel(Message):
    """Curves of one pump and of its main: as configured, as learnt when healthy, as the last verdict sees them.

    Parameters
    ----------
    pump : int
        Which one, counted from 1.
    name : str, optional
        What people call it; none where it has its number only.
    main : str, optional
        What people call its main.
    header : list of int
        Pumps on its common header, itself among them; over their total flow goes the system curve.
    configured_pump, configured_system : Curve
        As the station file says; without a band.
    learnt_pump, learnt_system : Curve, optional
        As learnt when healthy; none until learning has ended.
    now_pump, now_system : Curve, optional
        As the last verdict sees them; none until a run was judged.
    """

    pump: int = Field(ge=1)
    name: str | None = None
    main: str | None = None
    header: tuple[int, ...] = ()
    configured_pump: Curve
    configured_system: Curve
    learnt_pump: Curve | None = None
    learnt_system: Curve | None = None
    now_pump: Curve | None = None
    now_system: Curve | None = None


class Model(Message):
    """What the detector takes a station to be, published when it changes.

    Parameters
    ----------
    nominal_frequency_hz : float
        Of the drives.
    start_levels_m, stop_levels_m : list of float
        Level at which the n-th pump starts, and at which the n-th running pump stops.
    floor_area_m2 : float
        Area of the wet well at its floor.
    floor_level_m : float
        Level at which the wet well is empty.
    is_common_header : bool
        Whether all pumps are on one header, and the system curve is over the total flow.
    pumps : list of PumpModel
        In the order of the station file.
    """

    schema_name: Literal["wetwell.model/1"] = Field("wetwell.model/1", alias="schema")
    time: Stamp
    station: str
    nominal_frequency_hz: float
    start_levels_m: tuple[float, ...]
    stop_levels_m: tuple[float, ...]
    floor_area_m2: float
    floor_level_m: float = 0.0
    is_common_header: bool = False
    pumps: tuple[PumpModel, ...]
