"""Ways in which a truth of the elastic plant may deviate from its station file, by name."""

from wetwell.sim2real.truth.elastic.kind import ElasticKind
from wetwell.sim2real.truth.elastic.library_kinds import LIBRARY_KINDS
from wetwell.sim2real.truth.elastic.open_kinds import OPEN_KINDS

DEVIATIONS: dict[str, ElasticKind] = LIBRARY_KINDS | OPEN_KINDS
LIBRARY, OPEN = tuple(LIBRARY_KINDS), tuple(OPEN_KINDS)
