"""A station at which the process dies is known to the next one, and left out after some tries."""

import subprocess
import sys

from wetwell.services.detector.quarantine import Quarantine

DIE = """
import os, sys
from pathlib import Path
from wetwell.services.detector.quarantine import Quarantine

quarantine = Quarantine(Path(sys.argv[1]), "shard-3", 2)
quarantine.enter("alpha")
quarantine.leave()
quarantine.enter("beta")
os.kill(os.getpid(), 9)
"""


def test_the_station_at_which_a_process_died_is_left_out_after_its_tries(tmp_path, caplog):
    for _ in range(2):
        assert not Quarantine(tmp_path, "shard-3", 2).holds("beta")
        assert subprocess.run([sys.executable, "-c", DIE, str(tmp_path)], check=False).returncode == -9
    quarantine = Quarantine(tmp_path, "shard-3", 2)
    assert quarantine.holds("beta")
    assert not quarantine.holds("alpha")
    assert "station 'beta': the process died while it was judged (2 of 2)" in caplog.text
    quarantine.release("beta")
    assert not quarantine.holds("beta")


def test_an_end_in_good_order_leaves_no_trace(tmp_path):
    quarantine = Quarantine(tmp_path, "detector", 1)
    quarantine.enter("alpha")
    quarantine.leave()
    quarantine.close()
    assert not Quarantine(tmp_path, "detector", 1).holds("alpha")


def test_without_a_folder_nothing_is_kept():
    quarantine = Quarantine(None, "detector", 1)
    quarantine.enter("alpha")
    assert not quarantine.holds("alpha")
