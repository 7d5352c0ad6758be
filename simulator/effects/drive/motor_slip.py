"""Slip of the motors."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters, PumpParameters


class MotorSlip(Effect):
    r"""An asynchronous motor turns slower than its frequency asks for, in proportion to its torque.

    $$N = N_c - s\, \frac{M}{M_n}, \qquad \frac{M}{M_n} = \frac{P_s(Q, N)}{N P_n}, \qquad
    P = P_c \left(\frac{N}{N_c}\right)^{e}$$

    The torque M is that of the speed N that the motor has: shaft power over speed, where the shaft power is a
    straight line in the flow from the station's `shutoff_power_share` of the rated one at no flow. The smaller that
    share, the less a throttled pump slips. Under a constant ratio of voltage and frequency a torque takes as much
    speed at any frequency. Where the electrical power follows the load, $P_c$ has that torque at the speed $N_c$ of
    the field; where it does not, $P_c$ is the power of the command.

    Parameters
    ----------
    slip : float
        s, share of the speed that is lost at the rated torque M_n; 0 is no effect. [1]
    power_exponent : float
        e, power of the speed with which the electrical power P falls under $P_c$: 0 where it follows the command, or
        the torque. Of a power that follows the frequency it is 2 where the torque follows the affinity laws, and more
        where a high lift lets the flow fall faster than the speed. [1]

    References
    ----------
    .. [1] After A. E. Fitzgerald et al., Electric Machinery: slip of induction machines at small load.
    """

    component: ClassVar[Component] = "drive"
    neutral: ClassVar[dict[str, float]] = {"slip": 0.0, "power_exponent": 0.0}

    name: Literal["motor_slip"] = "motor_slip"
    slip: Annotated[float, limits(0.0, 0.15, "1")]
    power_exponent: Annotated[float, limits(0.0, 5.0, "1")] = 0.0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Let the motors slip; of two slips the power falls as by both."""
        return parameters.with_pumps(self._slipping)

    def _slipping(self, pump: PumpParameters) -> PumpParameters:
        if self.slip == 0.0:
            return pump
        slip, exponent = pump.slip + self.slip, self.power_exponent
        exponent += pump.slip / slip * (pump.slip_power_exponent - exponent)
        return replace(pump, slip=slip, slip_power_exponent=exponent)
