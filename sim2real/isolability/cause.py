"""What is to be told apart: an effect or a fault, with the forms that it may have."""

from dataclasses import dataclass
from typing import Literal

from wetwell.simulator.effects.effect import Effect
from wetwell.simulator.faults.profile import Profile

MOST_SIZES = 10.0
"""So many times its material size a cause is at the most: what is larger is seen without any of this. [1]"""

CauseKind = Literal["effect", "fault"]
Form = Effect | Profile


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """An effect of the library, or a fault that the detector looks for.

    Attributes
    ----------
    name : str
    kind : "effect" or "fault"
        Effects are told apart from effects, for they are there from the first day on; faults from faults.
    component : str
        Where it lies; of a fault pump, system or sensor.
    forms : tuple
        The plain one first: what the cause may look like is a sum of their signatures at material size.
    is_one_sided : bool
        Whether it cannot be less than nothing, as wear.
    share : float
        Of the material size, that the forms have. [1]
    """

    name: str
    kind: CauseKind
    component: str
    forms: tuple[Form, ...]
    is_one_sided: bool
    share: float = 1.0

    @property
    def signs(self) -> tuple[float, ...]:
        """Of what there is of it."""
        return (1.0,) if self.is_one_sided else (1.0, -1.0)

    @property
    def limits(self) -> tuple[float, float]:
        """Least and most of each form, in material sizes."""
        return (0.0 if self.is_one_sided else -MOST_SIZES), MOST_SIZES
