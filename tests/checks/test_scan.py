"""What the scanners of `make audit` say of the units, and how their words are read."""

import shutil
from pathlib import Path

import pytest
from ci_module import ci_module

ROOT = Path(__file__).parents[2]
UNITS = sorted((ROOT / "services" / "systemd").glob("*.service"))


@pytest.fixture(scope="module")
def scan():
    return ci_module("scan")


def test_the_units_are_held_tight(scan):
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd-analyze is not installed")
    command = ["systemd-analyze", "--no-pager", "security", "--offline=true", *map(str, UNITS)]
    code, text = scan.of_units(scan.asked(command, ""))
    assert code == 0, text
    assert f"{len(UNITS)} units" in text


def test_a_scanner_that_finds_something_or_says_nothing_is_not_called_clean(scan):
    assert scan.of_units("exposure level for a.service: 9.6 UNSAFE")[0] == 1
    assert scan.of_units("") == (1, "systemd-analyze: 0 units, exposure at most 10 of 10")
    assert scan.of_dockerfile("docker/Dockerfile:3 DL3006 warning: tag it\n")[0] == 1
    failed = {"check_id": "CKV_1", "check_name": "no root", "resource": "Pod.a"}
    told = {"summary": {"passed": 3}, "results": {"failed_checks": [failed]}}
    assert scan.of_manifests(told) == (1, "checkov: CKV_1 no root: Pod.a\ncheckov: 3 of 4 checks passed")
    assert scan.of_manifests([told | {"results": {"failed_checks": []}}])[0] == 0


def test_a_scanner_that_is_not_here_is_named(scan, monkeypatch):
    monkeypatch.setattr(scan.shutil, "which", lambda *_, **__: None)
    assert [code for code, _ in scan.reports("")] == [0, 0, 0]
    assert all(text.endswith("NOT DONE, it is not installed") for _, text in scan.reports(""))
