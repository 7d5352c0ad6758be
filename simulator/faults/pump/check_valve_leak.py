"""Check valve that does not close."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from wetwell.protocols.arrays import Floats
from wetwell.simulator.faults.profile import PumpFault
from wetwell.simulator.forcing import Forcing


class CheckValveLeak(PumpFault):
    r"""Water flows from the main back into the wet well while the pump stands.

    $$Q_\text{back} = K\, r(t) \sqrt{H / 1\,\text{m}}, \qquad
    H = H_s \text{, on a common header } H_s + k Q |Q|, \quad Q = \sum_i Q_i - \sum Q_\text{back}$$

    No meter shows it: the pump's own reads 0 while it stands. The level rises faster and pumps start more often. On a
    common header the running pumps deliver it, too: they carry more, at a lower head. The main is taken to stay full.

    Parameters
    ----------
    leak_m3h : float
        K, flow at a head of 1 m at full strength. [m³/h]

    References
    ----------
    .. [1] After I. E. Idelchik, Handbook of Hydraulic Resistance: flow through an orifice.
    """

    neutral: ClassVar[dict[str, Any]] = {"leak_m3h": 0.0}

    kind: Literal["check_valve_leak"] = "check_valve_leak"
    leak_m3h: Annotated[float, Field(ge=0, le=1000)] = 10.0

    def apply(self, forcing: Forcing, time_s: Floats) -> None:
        """Add to the leak of the pump's check valve over a block that begins at `time_s[0]`."""
        forcing.valve_leak_m3h[self.pump - 1] += self.leak_m3h * self.share(time_s)
