"""Voltage of the supply."""

from typing import Annotated, ClassVar, Literal

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.forcing import Forcing


class SupplyVoltageVariation(Effect):
    r"""The voltage of the supply swings over the day, and faster; power follows it.

    $$\frac{U}{U_n} = 1 + a_d \cos\left(2 \pi \frac{t - t_d}{24\,\text{h}}\right)
    + a_f \sin\left(2 \pi \frac{t - t_f}{T_f}\right)$$

    Time counts from the start of the scenario.

    Parameters
    ----------
    daily_amplitude : float
        a_d, share by which the voltage swings over the day; 0 is none. [1]
    daily_phase_h : float
        t_d, hours from the start to the highest voltage. [h]
    fast_amplitude : float
        a_f, share by which it swings beside that, faster; 0 is none. [1]
    fast_period_s : float
        T_f, time from one high of the faster swing to the next; half a day where a grid is loaded in the morning and
        in the evening. [s]
    fast_phase_s : float
        t_f, from the start to the first rise through the mean. [s]

    References
    ----------
    .. [1] After EN 50160, Voltage characteristics of electricity supplied by public networks: slow and fast changes.
    """

    component: ClassVar[Component] = "drive"
    neutral: ClassVar[dict[str, float]] = {"daily_amplitude": 0.0, "fast_amplitude": 0.0}

    name: Literal["supply_voltage_variation"] = "supply_voltage_variation"
    daily_amplitude: Annotated[float, limits(0.0, 0.2, "1")] = 0.0
    daily_phase_h: Annotated[float, limits(0.0, 24.0, "h")] = 0.0
    fast_amplitude: Annotated[float, limits(0.0, 0.2, "1")] = 0.0
    fast_period_s: Annotated[float, limits(4.0, 5.0e4, "s")] = 300.0
    fast_phase_s: Annotated[float, limits(0.0, 5.0e4, "s")] = 0.0

    def force(self, forcing: Forcing, time_s: Floats) -> None:
        """Scale the voltage."""
        daily = np.cos(2.0 * np.pi * (time_s / 3600.0 - self.daily_phase_h) / 24.0)
        fast = np.sin(2.0 * np.pi * (time_s - self.fast_phase_s) / self.fast_period_s)
        forcing.voltage_factor[:] *= 1.0 + self.daily_amplitude * daily + self.fast_amplitude * fast
