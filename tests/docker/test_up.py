"""`docker compose up` where an engine answers; where none does, the test is skipped and says that it was not run."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

pytestmark = [pytest.mark.check, pytest.mark.timeout(1800)]

ROOT = Path(__file__).parents[2]
IMAGE = "wetwell:test"
SERVICES = {"router", "simulator", "detector", "historian", "alarms", "watch", "dashboard"}


def answers(*words: str) -> bool:
    """Whether a command is there and succeeds."""
    return (
        shutil.which(words[0]) is not None and subprocess.run(words, capture_output=True, check=False).returncode == 0
    )


def compose_words() -> list[str]:
    """How Docker Compose is called here; without it or without an engine the test is skipped."""
    if not answers("docker", "info"):
        pytest.skip("docker compose up was not run: no engine answers")
    for words in (["docker", "compose"], ["docker-compose"]):
        if answers(*words, "version"):
            return words
    pytest.skip("docker compose up was not run: there is an engine, but no Docker Compose")


@pytest.mark.parametrize(
    ("known", "said"),
    [
        ("none", "was not run: no engine answers"),
        ("info", "was not run: there is an engine, but no Docker Compose"),
        ("info|compose", None),
    ],
)
def test_it_is_run_where_it_can_be_and_else_says_that_it_was_not(known, said, tmp_path, monkeypatch):
    (tmp_path / "docker").write_text(f'#!/bin/sh\ncase "$1" in {known}) exit 0;; *) exit 1;; esac\n')
    (tmp_path / "docker").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    if said is None:
        assert compose_words() == ["docker", "compose"]
    else:
        with pytest.raises(pytest.skip.Exception, match=said):
            compose_words()


def test_a_site_comes_up_and_all_its_containers_are_healthy(tmp_path):
    words = compose_words()
    shutil.copytree(ROOT / "docker", tmp_path / "docker", ignore=shutil.ignore_patterns("secrets", "site*"))
    subprocess.run(["sh", tmp_path / "docker" / "secrets.sh"], check=True, capture_output=True)
    subprocess.run(["make", "image", f"IMAGE={IMAGE}"], cwd=ROOT, check=True)
    site = [*words, "--project-name", "wetwell-test", "--file", str(tmp_path / "docker" / "compose.yaml")]
    site += ["--profile", "demo"]
    environment = os.environ | {"WETWELL_IMAGE": IMAGE}
    try:
        up = [*site, "up", "--detach", "--wait", "--wait-timeout", "900"]  # succeeds when all are healthy
        subprocess.run(up, env=environment, check=True)
        running = [*site, "ps", "--services", "--status", "running"]
        listed = subprocess.run(running, env=environment, check=True, capture_output=True, text=True).stdout
        assert set(listed.split()) == SERVICES
    finally:
        subprocess.run([*site, "down", "--volumes"], env=environment, check=True)
