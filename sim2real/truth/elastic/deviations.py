"""Ways in which a truth of the elastic plant may deviate from its station file, by name."""

from wetwell.sim2real.truth.elastic.kind import ElasticKind
from wetwell.sim2real.truth.elastic.library_kinds import LIBRARY_FORMS
from wetwell.sim2real.truth.elastic.open_kinds import OPEN_FORMS

ELASTIC_DEVIATIONS: dict[str, ElasticKind] = LIBRARY_FORMS | OPEN_FORMS
ELASTIC_LIBRARY, ELASTIC_OPEN = tuple(LIBRARY_FORMS), tuple(OPEN_FORMS)
