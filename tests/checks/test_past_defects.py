"""`benchmarks/defects.py` can put each defect of the past back: its place is in the code, once."""

import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAST_DEFECTS = runpy.run_path(str(ROOT / "benchmarks" / "past_defects.py"))["PAST_DEFECTS"]


@pytest.mark.parametrize("defect", PAST_DEFECTS, ids=lambda defect: defect.name)
def test_the_place_of_a_defect_is_there_once(defect):
    assert (ROOT / defect.path).read_text(encoding="utf-8").count(defect.now) == 1
