"""Defects of the project's past, each put back beside the accident that shows it: a rule must break."""

import contextlib
import random
import sqlite3
from collections.abc import AsyncIterator
from pathlib import Path
from unittest import mock

import pytest
from accidents import Accident
from rules import broken_rules
from site_kinds import light_site

from wetwell.protocols.messages.sample import Sample
from wetwell.services.alarms.service import AlarmService
from wetwell.services.detector.station_detector import StationDetector
from wetwell.services.historian import daemon as historian_daemon
from wetwell.services.historian.spool import Spool
from wetwell.services.runtime.folder_lock import Hold

pytestmark = pytest.mark.check

NOON_S = 43_200.0
EVERY_H = [NOON_S + 3_600.0 * hour for hour in range(8)]


def no_lock(*_: object) -> contextlib.AbstractContextManager[Hold]:
    return contextlib.nullcontext(Hold(None, ""))


def always(*_: object) -> bool:
    return True


async def nothing_missed(*_: object) -> AsyncIterator[list[Sample]]:
    for never in ():
        yield never


def flip_bit_of_row(folder: Path, dice: random.Random) -> Path:
    """What a disk has changed in the values of one row of samples."""
    path = folder / "live.sqlite"
    with contextlib.closing(sqlite3.connect(path)) as database, database:
        rows = database.execute("SELECT station, time_ns, seq, data FROM sample").fetchall()
        *key, data = dice.choice(rows)
        changed = bytearray(data)
        changed[dice.randrange(len(changed))] ^= 1 << dice.randrange(8)
        query = "UPDATE sample SET data = ? WHERE station = ? AND time_ns = ? AND seq = ?"
        database.execute(query, (bytes(changed), *key))
    return path


STORE = "wetwell.services.historian.store"
DEFECTS = {
    "two detectors on a folder": (
        [mock.patch("wetwell.services.detector.daemon.folder_held", no_lock)],
        [Accident("twin", "detector", at_s, 3_000.0) for at_s in EVERY_H],
    ),
    "rows of samples are not checked": (
        [mock.patch(f"{STORE}.live.{module}.is_sample_intact", always) for module in ("database", "file", "salvage")],
        [Accident("rot", "historian", at_s, 1.0, seed) for seed, at_s in enumerate(EVERY_H)],
    ),
    "what the store refuses is lost": (
        [mock.patch.object(Spool, "put_back")],
        [Accident("full", "machine", at_s, 2_000.0) for at_s in EVERY_H],
    ),
    "nothing that was told before the start is taken": (
        [mock.patch.object(historian_daemon, "ALL_KEPT", 0)],
        [Accident("kill", "historian", at_s, 2_000.0) for at_s in EVERY_H],
    ),
    "the historian is not asked for what was missed": (
        [mock.patch("wetwell.services.detector.intake.missed_samples", nothing_missed)],
        [
            accident
            for at_s in EVERY_H
            for accident in (
                Accident("kill", "detector", at_s, 3_000.0),
                Accident("kill", "gateway", at_s + 2_700.0, 1.0),
            )
        ],
    ),
    "a detector that goes on does not tell its last verdicts": (
        [mock.patch.object(StationDetector, "_tell_again")],
        [Accident("stop", "detector", 86_400.0 - 600.0, 1.0)],
    ),
    "a detector does not say which verdicts are lost": (
        [mock.patch("wetwell.services.detector.unheard._say")],
        [Accident("mute", "detector", 10_000.0, 70_000.0), Accident("kill", "detector", 75_000.0, 1.0)],
    ),
    "alarms that start do not tell what stands": (
        [mock.patch.object(AlarmService, "publish_all")],
        [Accident("kill", "gateway", 86_400.0 - 8_000.0, 7_900.0), Accident("kill", "alarms", 86_400.0 - 600.0, 1.0)],
    ),
}


@pytest.mark.parametrize("name", DEFECTS)
def test_a_defect_breaks_a_rule_that_holds_without_it(folder, name):
    patches, accidents = DEFECTS[name]
    plan = tuple(sorted(accidents, key=lambda accident: accident.at_s))
    with contextlib.ExitStack() as defect:
        defect.enter_context(mock.patch("acts.flip_bits", flip_bit_of_row))
        assert broken_rules(light_site(3, 1, 1.0, 300, folder / "without", plan)) == []
        for patch in patches:
            defect.enter_context(patch)
        assert broken_rules(light_site(3, 1, 1.0, 300, folder / "with", plan)) != []
