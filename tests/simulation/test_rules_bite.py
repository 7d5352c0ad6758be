"""Defects of the project's past, each put back beside the accident that shows it: a rule must break."""

import contextlib
from unittest import mock

import pytest
from accidents import Accident
from rules import broken_rules
from site_kinds import light_site

from wetwell.services.historian import daemon as historian_daemon
from wetwell.services.historian.spool import Spool

pytestmark = pytest.mark.check

NOON_S = 43_200.0
EVERY_H = [NOON_S + 3_600.0 * hour for hour in range(8)]


def no_lock(*_: object) -> contextlib.AbstractContextManager[None]:
    return contextlib.nullcontext()


def always(*_: object) -> bool:
    return True


STORE = "wetwell.services.historian.store"
DEFECTS = {
    "two detectors on a folder": (
        [mock.patch("wetwell.services.detector.daemon.folder_held", no_lock)],
        [Accident("twin", "detector", at_s, 3_000.0) for at_s in EVERY_H],
    ),
    "rows of samples are not checked": (
        [mock.patch(f"{STORE}.{module}.is_sample_intact", always) for module in ("live.database", "live.salvage")],
        [Accident("stop", "historian", at_s, 1.0) for at_s in EVERY_H]  # what is in its log comes into the file
        + [Accident("rot", "historian", at_s + number, 1.0, number) for at_s in EVERY_H for number in range(60, 120)],
    ),
    "what the store refuses is lost": (
        [mock.patch.object(Spool, "put_back")],
        [Accident("full", "machine", at_s, 2_000.0) for at_s in EVERY_H],
    ),
    "nothing that was told before the start is taken": (
        [mock.patch.object(historian_daemon, "ALL_KEPT", 0)],
        [Accident("kill", "historian", at_s, 2_000.0) for at_s in EVERY_H],
    ),
}


@pytest.mark.parametrize("name", DEFECTS)
def test_a_defect_breaks_a_rule_that_holds_without_it(folder, name):
    patches, accidents = DEFECTS[name]
    plan = tuple(sorted(accidents, key=lambda accident: accident.at_s))
    assert broken_rules(light_site(3, 1, 1.0, 300, folder / "without", plan)) == []
    with contextlib.ExitStack() as defect:
        for patch in patches:
            defect.enter_context(patch)
        assert broken_rules(light_site(3, 1, 1.0, 300, folder / "with", plan)) != []
