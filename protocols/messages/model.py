"""What the detector believes of a station: curves as configured and as learnt."""

from typing import Literal

from pydantic import Field

from wetwell.protocols.messages.message import Message, Number, Stamp


class Curve(Message):
    """Head over flow at nominal frequency, with the 95 % band of the healthy pump or main."""

    flow_m3h: tuple[float, ...]
    head_m: tuple[Number, ...]
    low_m: tuple[Number, ...] = ()
    high_m: tuple[Number, ...] = ()


class PumpModel(Message):
    """Curves of one pump and of its main: as configured, as learnt when healthy, as the last verdict sees them.

    `name` is what people call it, None where it has its number only, `main` what they call its main. `header` are the
    pumps on its common header, itself among them; over their total flow goes the system curve. `configured_*` are
    without a band. `learnt_*` are None until learning has ended, `now_*` until a run was judged.
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
    """Model of a station, published when it changes.

    `is_common_header`: all its pumps are on one header, and the system curve is over the total flow.
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
