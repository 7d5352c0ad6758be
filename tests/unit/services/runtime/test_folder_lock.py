"""One daemon of a kind to a folder."""

import subprocess
import sys

import pytest

from wetwell.protocols.errors import ConfigError
from wetwell.services.runtime.folder_lock import folder_held


def test_a_second_of_the_same_name_is_refused_until_the_first_has_gone(tmp_path):
    folder = tmp_path / "state"
    with folder_held(folder, "detector.state_dir", "detector"):
        with (
            pytest.raises(ConfigError, match=r"^detector\.state_dir: .*state: another detector works here$"),
            folder_held(folder, "detector.state_dir", "detector"),
        ):
            pass
        with folder_held(folder, "alarms.state_dir", "alarms"):  # others may
            pass
    with folder_held(folder, "detector.state_dir", "detector"):
        pass


def test_a_process_that_dies_lets_go(tmp_path):
    code = (
        "import os, pathlib, sys\n"
        "from wetwell.services.runtime.folder_lock import folder_held\n"
        "with folder_held(pathlib.Path(sys.argv[1]), 'alarms.state_dir', 'alarms'):\n"
        "    os.kill(os.getpid(), 9)\n"
    )
    ended = subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=False)
    assert ended.returncode == -9
    with folder_held(tmp_path, "alarms.state_dir", "alarms"):
        pass


def test_without_a_folder_nothing_is_held():
    with folder_held(None, "alarms.state_dir", "alarms"), folder_held(None, "alarms.state_dir", "alarms"):
        pass
