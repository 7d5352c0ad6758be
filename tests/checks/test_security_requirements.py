"""The page that holds the project against IEC 62443-3-3 names tests that there are."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
REQUIREMENTS = (ROOT / "docs/security-requirements.md").read_text()
ROWS = re.findall(r"^\| (SR .*?) \| (\w+) \| .*? \| ?(.*?) ?\|$", REQUIREMENTS, re.MULTILINE)
TESTS = {
    name for file in (ROOT / "tests").rglob("test_*.py") for name in re.findall(r"def (test_\w+)\(", file.read_text())
}
LEVEL_2 = {1: [*range(1, 14)], 2: [*range(1, 7), 8, 9, 10, 11], 3: [*range(1, 10)], 4: [1, 2, 3]}
LEVEL_2 |= {5: [1, 2, 3, 4], 6: [1, 2], 7: [*range(1, 9)]}
"""Requirements of level 2 and below by chapter; 2.7 and 2.12 begin with level 3."""


@pytest.mark.parametrize(("requirement", "met", "tests"), ROWS, ids=[row[0][:20] for row in ROWS])
def test_each_test_that_is_named_is_there(requirement, met, tests):
    named = re.findall(r"`(\w+)`", tests)
    assert set(named) <= TESTS, requirement
    assert bool(named) == (met in {"yes", "partly"}), requirement


def test_every_requirement_of_the_level_has_a_row():
    named = re.findall(r"SR (\d)\.(\d+)", " ".join(row[0] for row in ROWS))
    assert sorted((int(a), int(b)) for a, b in named) == sorted((a, b) for a, all_b in LEVEL_2.items() for b in all_b)


def test_the_threat_model_answers_each_question_of_each_way_and_names_tests_that_there_are():
    parts = re.split(r"^## F\d: ", (ROOT / "docs/threat-model.md").read_text(), flags=re.MULTILINE)[1:]
    assert len(parts) == 7
    for part in parts:
        rows = re.findall(r"^\| ([STRIDE]) \| (.+?) \| (SR \d\.\d+) \| (.+?) \|$", part, re.MULTILINE)
        assert "".join(letter for letter, *_ in rows) == "STRIDE"
        for _, answer, requirement, shown in rows:
            assert re.search(rf"^\|.*{re.escape(requirement)}\b", REQUIREMENTS, re.MULTILINE), answer
            named = set(re.findall(r"`(test_\w+)`", shown))
            assert named <= TESTS, answer
            assert named or shown == "reason", answer
