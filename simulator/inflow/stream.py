"""What every inflow model gives: a stream of seconds."""

from typing import Protocol

from wetwell.protocols.arrays import Floats


class InflowStream(Protocol):
    """Inflow, second by second, from the start of the scenario on.

    The numbers do not depend on the lengths in which they are taken.
    """

    def next_seconds(self, seconds: int) -> Floats:
        """(seconds,) inflow of the next seconds, >= 0, in m³/h."""
