"""The catalogues of the page hold every text of it, and no other; so do those of what services say in words."""

import re
from importlib.resources import files
from typing import get_args

import pytest

from wetwell.detector.verdict.maintenance import _ADVICE, _CURED
from wetwell.services.alarms.rules import RULES
from wetwell.services.runtime.health.metrics import METRICS
from wetwell.simulator.effects import LIBRARY
from wetwell.simulator.effects.effect import Component

STATIC = files("wetwell.services") / "dashboard" / "static"
LANGUAGES = ("de",)
SERVICES_SAY = {*_ADVICE.values(), *_CURED, *(rule.advice for rule in RULES.values())}
SERVICES_NAME = {name.replace("_", " ") for name in (*LIBRARY, *get_args(Component))}
"""Effects and places by which the watch calls a gap."""
OF_OTHERS = (
    *("taken", "committed", "waiting", "failed_commits", "commit_age_s", "lag_s", "live_bytes", "disk_free_bytes"),
    *(
        "clients",
        "is_connected",
        "connections",
        "reconnects",
        "good_polls",
        "last_good_poll_age_s",
        "heartbeat_age_s",
    ),
    *("missing", "stuck", "dead", "noisy"),
)
SERVICES_COUNT = {re.sub(r"_(s|bytes)$", "", name).replace("_", " ") for name in (*METRICS, *OF_OTHERS)}
"""Health figures as the page shows them, and what a verdict finds of meters."""


def modules(folder):
    for entry in folder.iterdir():
        if entry.is_dir() and entry.name != "words":
            yield from modules(entry)
        elif entry.name.endswith(".js"):
            yield entry.read_text(encoding="utf-8")


def page_texts():
    found = {text for module in modules(STATIC / "js") for text in re.findall(r'\bt\("((?:[^"\\]|\\.)*)"', module)}
    shell = (STATIC / "index.html").read_text(encoding="utf-8")
    labels = re.findall(r'aria-label="([^"]+)"', shell)
    return found | set(re.findall(r"data-t>([^<]+)<", shell)) | set(labels)


def catalogue(language):
    lines = (STATIC / "js" / "words" / f"{language}.js").read_text(encoding="utf-8")
    return dict(re.findall(r'^  "((?:[^"\\]|\\.)*)": "((?:[^"\\]|\\.)*)",$', lines, re.MULTILINE))


def test_the_page_has_texts():
    assert len(page_texts()) > 250


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_catalogue_lacks_no_text_and_holds_no_other(language):
    wanted = page_texts() | SERVICES_SAY | SERVICES_NAME | SERVICES_COUNT
    assert sorted(wanted - catalogue(language).keys()) == []
    assert sorted(catalogue(language).keys() - wanted) == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_translation_has_the_same_values_in_it(language):
    different = [text for text, told in catalogue(language).items() if places(text) != places(told)]
    assert different == []


def places(text):
    return sorted(re.findall(r"\{\w+\}", text))
