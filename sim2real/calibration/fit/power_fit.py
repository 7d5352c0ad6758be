"""Power of the pumps: the line of shaft power over the flow, with the datasheets as prior."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.calibration.fit.prior import Prior
from wetwell.sim2real.calibration.fit.regularised_fit import Posterior, regularised_fit
from wetwell.simulator.power import STANDING_LOSS_SHARE


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerLines:
    r"""Input power of pumps whose lines of shaft power differ from those of the datasheets in size and slope.

    $$P = P_n \frac{N^3 \left(c_i \left(s + (1 - s) x\right) + d_i (x - 1)\right) + c_0\, c_i}
    {(1 + c_0)\, \eta_m \eta_d}, \qquad x = \frac{Q}{N Q_n}$$

    Parameters are (2 pumps,): c of each pump, d of each pump.

    Attributes
    ----------
    rated_flow_m3h, rated_shaft_kw, shutoff_share : (pumps,) arrays
        Q_n, P_n and s of the datasheets. [m³/h, kW, 1]
    efficiency : float
        η of motor and drive together, at rated load.
    losses_share : float
        c₀, constant losses over the rated shaft power. [1]
    """

    rated_flow_m3h: Floats
    rated_shaft_kw: Floats
    shutoff_share: Floats
    efficiency: float
    losses_share: float = STANDING_LOSS_SHARE

    def design(self, pump: Integers, speed_ratio: Floats, flow_m3h: Floats) -> Floats:
        """(n, 2 pumps) input power for each unit of a parameter, of pumps at flows and speeds, (n,) each. [kW]."""
        pumps = self.rated_flow_m3h.size
        share = self.shutoff_share[pump]
        load = flow_m3h / (speed_ratio * self.rated_flow_m3h[pump])
        rated_kw = self.rated_shaft_kw[pump] / (self.efficiency * (1.0 + self.losses_share))
        rows = np.arange(pump.size)
        design = np.zeros((pump.size, 2 * pumps))
        design[rows, pump] = rated_kw * (speed_ratio**3 * (share + (1.0 - share) * load) + self.losses_share)
        design[rows, pumps + pump] = rated_kw * speed_ratio**3 * (load - 1.0)
        return design

    def points(self, parameters: Floats, pump: int) -> tuple[tuple[float, float], tuple[float, float]]:
        """Two points (flow, shaft power) of a changed line at nominal speed, at half the rated flow and at it."""
        scale, slope = parameters[pump], parameters[self.rated_flow_m3h.size + pump]
        share, rated_kw = self.shutoff_share[pump], self.rated_shaft_kw[pump]
        rated_m3h = float(self.rated_flow_m3h[pump])
        half_kw = rated_kw * (scale * (share + (1.0 - share) / 2.0) - slope / 2.0)
        return (rated_m3h / 2.0, float(half_kw)), (rated_m3h, float(scale * rated_kw))


def fit_power(
    lines: PowerLines,
    prior: Prior,
    *,
    pump: Integers,
    run: Integers,
    speed_ratio: Floats,
    flow_m3h: Floats,
    power_kw: Floats,
) -> Posterior:
    """Parameters of the lines from steady values of pumps, (n,) each; runs count from 0 without a gap.

    Motor and drive take a factor that no recording can tell from that of the pump: it is in the scale.
    """
    relative = lines.design(pump, speed_ratio, flow_m3h) / power_kw[:, None]

    def errors(parameters: Floats) -> list[tuple[Floats, Floats]]:
        return [(relative @ parameters - 1.0, relative)]

    return regularised_fit(errors, [run], [False], prior)
