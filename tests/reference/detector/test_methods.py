"""The baselines on the paper's two days: where a prototype, written apart from this code, found them.

Macro F1 of the prototype: always "normal" .305, the nested F-test as written .42 to .43, the tangent index as written
.305, the index of 25-sample segments across runs .77 (.85 with slopes that allow for errors in Q), the F-test for a
shift .988. The segments score higher here: their slopes are the simulated station's own, taken from the datasheet.
"""

import pytest

from wetwell.detector.evaluation.scores import macro_f1
from wetwell.services.batch.backtest import SimulatedRecording, judge
from wetwell.services.stations import find_scenario

pytestmark = pytest.mark.long

SEED = 20
BOUNDS = {
    "always_normal": (0.29, 0.32),
    "paper_f_test": (0.30, 0.50),
    "paper_tangent": (0.29, 0.34),
    "paper_tangent_segments": (0.85, 1.0),
    "paper_f_shift": (0.93, 1.0),
    "cusum_statsmodels": (0.93, 1.0),
}


@pytest.fixture(scope="module")
def outcomes(alpha):
    return judge(SimulatedRecording(alpha, find_scenario("paper"), SEED), list(BOUNDS))


@pytest.mark.parametrize("name", BOUNDS)
def test_the_score_is_where_it_was_found_before(name, outcomes):
    low, high = BOUNDS[name]
    assert low <= macro_f1(outcomes[name].runs) <= high


def test_all_are_scored_on_the_same_runs(outcomes):
    truths = {name: [(run.pump, run.truth) for run in outcome.runs] for name, outcome in outcomes.items()}
    assert all(truth == truths["always_normal"] for truth in truths.values())
    assert len(truths["always_normal"]) > 150
