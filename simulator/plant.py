"""A plant that runs: its parameters and its state, moved on by the kernel."""

from collections.abc import Sequence

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import SameTypes
from wetwell.protocols.orders import Step, orders_of
from wetwell.simulator.forcing import Forcing
from wetwell.simulator.kernel import simulate_seconds
from wetwell.simulator.parameters import PlantParameters
from wetwell.simulator.state import Truth, first_state, still_truth
from wetwell.simulator.telemetry.channels import channels
from wetwell.simulator.wet_well import level_at_volume_m, volume_at_level_m3

_simulate_seconds = SameTypes(simulate_seconds)


class Plant:
    """A plant that runs: the records that the kernel reads, and the state that it changes.

    Parameters
    ----------
    parameters : PlantParameters
    level_m : float
        Level at the beginning, with all pumps standing, for so long that all air has gathered. [m]
    steps : sequence of Step
        What an operator does from the first second on; then the controller is alone.

    Attributes
    ----------
    orders : Orders
        The same as the kernel reads it.
    start_levels_m, stop_levels_m : (n_max,) arrays
        May be changed in place. [m]
    is_automatic : (pumps,) array
        Whether the controller may start a pump; may be changed in place.
    """

    def __init__(self, parameters: PlantParameters, level_m: float, steps: Sequence[Step] = ()) -> None:
        self.orders = orders_of(steps, len(parameters.pumps))
        self._records = parameters.records()
        self._state = first_state(parameters, level_m)
        self.start_levels_m = self._records.start_levels_m
        self.stop_levels_m = self._records.stop_levels_m
        self.is_automatic = self._records.pumps["is_automatic"]

    @property
    def seconds(self) -> int:
        """Seconds since the beginning."""
        return int(self._state.station["second"][0])

    @property
    def level_m(self) -> float:
        """True level; may be set. [m]."""
        return level_at_volume_m(self._state.station["volume_m3"][0], self._records.profile)

    @level_m.setter
    def level_m(self, level_m: float) -> None:
        self._state.station["volume_m3"] = volume_at_level_m3(level_m, self._records.profile)

    @property
    def commanded(self) -> list[int]:
        """Commanded pumps, from 1, in the order of their starts."""
        return [int(pump) + 1 for pump in self._state.started[: self._state.station["running"][0]]]

    def advance(self, forcing: Forcing, rng: np.random.Generator) -> tuple[Floats, Truth]:
        """Advance by as many seconds as the forcing has: (channels, n) as measured, and as it truly was."""
        pumps, seconds = forcing.speed_factor.shape
        measured, truth = np.zeros((channels(pumps), seconds)), still_truth(pumps, seconds)
        _simulate_seconds(self._records, self._state, forcing, self.orders, rng, measured, truth)
        return measured, truth
