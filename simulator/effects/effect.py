"""What every effect is: a frozen set of parameters that changes the plant's parameters, or works into the forcing."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.table import Table
from wetwell.simulator.forcing import Forcing
from wetwell.simulator.parameters import PlantParameters

Component = Literal[
    "sump",
    "rising_main",
    "pump",
    "drive",
    "controller",
    "level_sensor",
    "flow_meter",
    "head_sensor",
    "power_meter",
    "telemetry",
    "station",
]

PumpNumber = Annotated[int, Field(ge=0, le=32, description="pump, counted from 1; 0 for all pumps")]
MainNumber = Annotated[int, Field(ge=0, le=32, description="main, counted from 1 as in the file; 0 for all mains")]


def limits(low: float, high: float, unit: str) -> Any:
    """Field of a parameter with its range and unit."""
    return Field(ge=low, le=high, allow_inf_nan=False, json_schema_extra={"unit": unit})


class Effect(Table):
    """Base of the effects: one component of the station that behaves otherwise than the plain model.

    A subclass is one file: the equation and its source, parameters with range and unit, and `modify` or `force`.
    `neutral` names the parameters that are its strength, with the values at which it changes nothing, bit for bit.
    `another_at` names those with an end of their range at which it is another effect, as rags that are there at once,
    or another station.
    `may_change` says that its strength may be another one weeks later: what wears, grows or drifts, and no geometry.
    `has_one_form` says that its name fixes its equation, as of a constant offset: only the size is open. `is_limit`
    says that readings pass its strength one by one: what it does has no slope. `forms` has values of a parameter
    between which no slope leads, as from rigid water to waves. `is_everywhere` says that each real station has some
    of it, so that its size is asked for even where it is too small to be told; `is_told` is false of what is never
    told, however large. `reach` says how far a diagnosis looks
    for a parameter: up to a size, or so many times what is usual at the station where that is more. `is_learnt` says
    that its form comes from a recording: it is not among those that a diagnosis tries. Its component is the
    "station", and its parameters say which part of it.

    Parameters
    ----------
    name : str
        Which effect.
    """

    component: ClassVar[Component]
    neutral: ClassVar[dict[str, float]]
    another_at: ClassVar[dict[str, Literal["low", "high"]]] = {}
    has_one_form: ClassVar[bool] = False
    is_limit: ClassVar[bool] = False
    forms: ClassVar[dict[str, tuple[float, ...]]] = {}
    may_change: ClassVar[bool] = False
    is_everywhere: ClassVar[bool] = False
    is_told: ClassVar[bool] = True
    reach: ClassVar[dict[str, tuple[float, float]]] = {}
    is_learnt: ClassVar[bool] = False

    name: str

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Parameters of the plant under this effect."""
        return parameters

    def force(self, forcing: Forcing, time_s: Floats) -> None:
        """Work into the forcing of a block that begins at `time_s[0]`; for what changes with time."""
