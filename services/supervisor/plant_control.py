"""The clock of the plant from the side of the supervisor: let go, hold, faster, slower, a slow look."""

from collections.abc import Awaitable, Callable

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.keys import plant_clock_key
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.plant_clock import PlantClock, PlantClockOrder
from wetwell.services.runtime.client import first_answer

SPEEDS = (1.0, 10.0, 60.0, 600.0)
"""Steps of the keys, as far as they lie under the full speed, which is the last one."""
CLOCK_ANSWER_S = 2.0


class PlantControl:
    """Orders to the clock of the plant, one after the other.

    Parameters
    ----------
    bus : Bus
    station : str
    """

    def __init__(self, bus: Bus, station: str) -> None:
        self._bus = bus
        self._key = plant_clock_key(station)

    async def order(self, order: PlantClockOrder) -> PlantClock:
        """How the clock stands after an order; asks until there is an answer.

        Raises
        ------
        MessageError
            If the answer is none.
        """
        answer = await first_answer(self._bus, self._key, order.encode(), timeout_s=CLOCK_ANSWER_S)
        clock = PlantClock.decode(answer)
        if clock.error:
            raise MessageError(clock.error)
        return clock

    async def release(self) -> PlantClock:
        """Let the plant go on."""
        return await self.order(PlantClockOrder(is_held=False))

    async def toggle(self) -> PlantClock:
        """Hold the plant, or let it go on where it is held."""
        clock = await self.order(PlantClockOrder())
        return await self.order(PlantClockOrder(is_held=not clock.is_held))

    async def faster(self) -> PlantClock:
        """One step faster."""
        return await self._step(lambda speed, steps: next((one for one in steps if one > speed), steps[-1]))

    async def slower(self) -> PlantClock:
        """One step slower."""
        return await self._step(lambda speed, steps: next((one for one in steps[::-1] if one < speed), steps[0]))

    async def look(self, look_s: float) -> PlantClock:
        """Let the plant run slowly for so long on the wall. [s]."""
        return await self.order(PlantClockOrder(look_s=look_s))

    async def _step(self, choose: Callable[[float, list[float]], float]) -> PlantClock:
        clock = await self.order(PlantClockOrder())
        return await self.order(PlantClockOrder(speed=choose(clock.speed, steps_of(clock.full_speed))))


def steps_of(full_speed: float) -> list[float]:
    """Speeds that one can choose, slowest first.

    Examples
    --------
    >>> steps_of(600.0), steps_of(15.0), steps_of(0.5)
    ([1.0, 10.0, 60.0, 600.0], [1.0, 10.0, 15.0], [0.5])
    """
    return [*(speed for speed in SPEEDS if speed < full_speed), full_speed]


KEYS: dict[str, Callable[[PlantControl], Awaitable[PlantClock]]] = {
    " ": PlantControl.toggle,
    "+": PlantControl.faster,
    "-": PlantControl.slower,
}
"""What the keys of the terminal do; `q` ends all."""
