"""Air at a high point of the rising main."""

from typing import Any, ClassVar, Literal

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.table import NonNegative
from wetwell.simulator.faults.profile import SystemFault
from wetwell.simulator.forcing import Forcing


class AirPocket(SystemFault):
    r"""A pocket of air behind a high point: the water falls through it and gains no head from the fall.

    $$H_s(t) = H_{s,0} + \Delta H_s\, r(t)$$

    The operating point climbs along the pump curve. Air that grows idle and is purged running is the effect of the
    same name.

    Parameters
    ----------
    main : int
        Which main, counted from 1; 0 for all.
    static_rise_m : float
        ΔH_s, height over which the pocket stretches at full strength. [m]

    References
    ----------
    .. [1] After M. Escarameia, Investigating hydraulic removal of air from water pipelines, Proceedings of the
       Institution of Civil Engineers, Water Management, 2007.
    """

    neutral: ClassVar[dict[str, Any]] = {"static_rise_m": 0.0}

    kind: Literal["air_pocket"] = "air_pocket"
    static_rise_m: NonNegative = 2.0

    def apply(self, forcing: Forcing, time_s: Floats) -> None:
        """Raise the static head over a block that begins at `time_s[0]`."""
        self.of_main(forcing.static_rise_m)[:] += self.static_rise_m * self.share(time_s)
