"""Ways in which a truth may deviate from its station file, by name."""

from wetwell.sim2real.truth.library_deviations import LIBRARY_KINDS
from wetwell.sim2real.truth.open_deviations import OPEN_KINDS
from wetwell.sim2real.truth.parts import Kind

DEVIATIONS: dict[str, Kind] = LIBRARY_KINDS | OPEN_KINDS
LIBRARY = tuple(LIBRARY_KINDS)
OPEN = tuple(OPEN_KINDS)
