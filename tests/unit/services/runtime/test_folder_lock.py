"""One daemon of a kind to a folder."""

import asyncio
import shutil
import subprocess
import sys

import pytest

from wetwell.protocols.errors import ConfigError
from wetwell.services.runtime import folder_lock
from wetwell.services.runtime.folder_lock import Hold, folder_held


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


def test_whose_folder_another_one_takes_the_place_of_has_lost_it(tmp_path, monkeypatch):
    monkeypatch.setattr(folder_lock, "CHECK_S", 0.01)
    folder, backup = tmp_path / "state", tmp_path / "backup"

    async def replaced(hold: Hold) -> None:
        watching = asyncio.create_task(hold.watch())
        await asyncio.sleep(0.05)
        assert not watching.done()
        shutil.copytree(folder, backup)
        shutil.rmtree(folder)
        shutil.copytree(backup, folder)
        await watching

    with folder_held(folder, "alarms.state_dir", "alarms") as hold:
        assert not hold.is_lost
        with pytest.raises(ConfigError, match=r"^alarms\.state_dir: .*state: its lock is gone: another folder"):
            asyncio.run(replaced(hold))
        with folder_held(folder, "alarms.state_dir", "alarms") as next_one:
            assert hold.is_lost
            assert not next_one.is_lost
