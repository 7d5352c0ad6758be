"""An effect whose strength is another one in each period: wear that grew, a meter that drifted."""

from dataclasses import dataclass

from wetwell.simulator.effects.effect import Effect


@dataclass(frozen=True, slots=True, kw_only=True)
class Changing:
    """An effect in each period of several recordings; a period is a recording that was left alone, and acts after it.

    Attributes
    ----------
    periods : tuple of Effect
        The same effect, of other strengths.
    """

    periods: tuple[Effect, ...]


Acting = Effect | Changing
"""What acts in a replay."""


def in_period(acting: Acting, period: int) -> Effect:
    """The effect as it is in a period, from 0."""
    return acting.periods[period] if isinstance(acting, Changing) else acting
