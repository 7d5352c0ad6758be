"""A station at which the process dies is known to the next one, and left out after some tries."""

import subprocess
import sys

import pytest

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.detector import quarantine as quarantine_module
from wetwell.services.detector.quarantine import Quarantine

DAY_S = 86_400.0
DIE = """
import os, sys
from pathlib import Path
from wetwell.services.detector.quarantine import Quarantine

quarantine = Quarantine(Path(sys.argv[1]), "shard-3", 2, 86_400.0)
quarantine.enter("alpha")
quarantine.leave()
quarantine.enter("beta")
os.kill(os.getpid(), 9)
"""


def test_the_station_at_which_a_process_died_is_left_out_after_its_tries(tmp_path, caplog):
    for _ in range(2):
        assert not Quarantine(tmp_path, "shard-3", 2, DAY_S).holds("beta")
        assert subprocess.run([sys.executable, "-c", DIE, str(tmp_path)], check=False).returncode == -9
    quarantine = Quarantine(tmp_path, "shard-3", 2, DAY_S)
    assert quarantine.holds("beta")
    assert not quarantine.holds("alpha")
    assert "station 'beta': the process died while it was judged (2 of 2)" in caplog.text
    quarantine.release("beta")
    assert not quarantine.holds("beta")
    with pytest.raises(ConfigError, match="keeps no crash of station 'beta', nothing to release"):
        quarantine.release("beta")


@pytest.mark.parametrize(
    ("hours", "is_left_out"),
    [
        ([0, 1, 2], True),
        ([0, 10, 24], True),
        ([0, 10, 25], False),
        ([0, 10, 25, 30], True),  # the first one is forgotten, the other three fall into one day
        ([0, 30, 60, 90, 120], False),
        ([100, 0, 1], False),  # the clock was set back: the first time lies in the future
    ],
)
def test_only_crashes_within_the_window_count_together(hours, is_left_out, tmp_path, monkeypatch):
    for hour in hours:
        monkeypatch.setattr(quarantine_module, "now_ns", lambda hour=hour: hour * 3600 * NS_PER_S)
        (tmp_path / "detector.at").write_bytes(b"beta")
        held = Quarantine(tmp_path, "detector", 3, DAY_S).holds("beta")
    assert held == is_left_out
    monkeypatch.setattr(quarantine_module, "now_ns", lambda: 10_000 * 3600 * NS_PER_S)
    assert Quarantine(tmp_path, "detector", 3, DAY_S).holds("beta") == is_left_out  # until it is released


def test_an_end_in_good_order_leaves_no_trace(tmp_path):
    quarantine = Quarantine(tmp_path, "detector", 1, DAY_S)
    quarantine.enter("alpha")
    quarantine.leave()
    quarantine.close()
    assert not Quarantine(tmp_path, "detector", 1, DAY_S).holds("alpha")


def test_without_a_folder_nothing_is_kept():
    quarantine = Quarantine(None, "detector", 1, DAY_S)
    quarantine.enter("alpha")
    assert not quarantine.holds("alpha")
    with pytest.raises(ConfigError, match="state_dir: not set"):
        quarantine.release("alpha")
