"""Clogging of the rising main."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.table import NonNegative
from wetwell.simulator.faults.profile import SystemFault
from wetwell.simulator.forcing import Forcing


class PipeClogging(SystemFault):
    r"""Deposits and trapped air: more friction, and more static head, for all pumps on the main.

    $$k(t) = k_0 (1 + \Delta k\, r(t)), \qquad H_s(t) = H_{s,0} + \Delta H_s\, r(t)$$

    The operating point climbs along the pump curve.

    Parameters
    ----------
    main : int
        Which main, counted from 1; 0 for all.
    friction_rise : float
        Δk, relative rise of the friction coefficient at full strength; negative where deposits wash out. [1]
    static_rise_m : float
        ΔH_s, rise of the static head at full strength. [m]

    References
    ----------
    .. [1] Eshkofti et al., Modeling and physics-enhanced fault detection in wastewater pump stations:
       pipe clogging scenario (Δk = 1, ΔH_s = 0.5 m).
    """

    neutral: ClassVar[dict[str, Any]] = {"friction_rise": 0.0, "static_rise_m": 0.0}

    kind: Literal["pipe_clogging"] = "pipe_clogging"
    friction_rise: Annotated[float, Field(gt=-1.0, allow_inf_nan=False)] = 1.0
    static_rise_m: NonNegative = 0.0

    def apply(self, forcing: Forcing, time_s: Floats) -> None:
        """Raise friction and static head over a block that begins at `time_s[0]`."""
        share = self.share(time_s)
        self.of_main(forcing.friction_factor)[:] *= 1.0 + self.friction_rise * share
        self.of_main(forcing.static_rise_m)[:] += self.static_rise_m * share
