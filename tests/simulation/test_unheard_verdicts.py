"""A detector that nobody hears, started anew meanwhile: its verdicts come later, or are said to be lost."""

import pytest
from accidents import Accident
from rules import broken_rules
from simulated_site import Site
from site_kinds import light_site

SEED = 2705997
"""Of a site whose detector saves its state each half hour."""
MUTE = Accident("mute", "detector", 16_373.9, 6_671.6)


def lost(site: Site) -> list[str]:
    return [told.text for told in site.log if "are lost" in told.text]


@pytest.mark.parametrize(
    "plan",
    [
        (MUTE, Accident("stop", "detector", 20_000.0, 1.0)),
        (MUTE, Accident("backup", "detector", 19_340.6, 1.0), Accident("backup", "detector", 19_704.2, 1.0)),
    ],
    ids=["started anew", "put back twice"],
)
def test_seed_2705997_tells_again_what_nobody_heard(folder, plan):
    site = light_site(SEED, 1, 2.0, 300, folder, plan)
    assert broken_rules(site) == []
    assert lost(site) == []


def test_what_nobody_heard_and_nobody_tells_again_is_said_to_be_lost(folder):
    plan = (
        Accident("mute", "detector", 10_000.0, 70_000.0),
        Accident("kill", "detector", 60_000.0, 1.0),
        Accident("kill", "detector", 75_000.0, 1.0),
    )
    site = light_site(SEED, 1, 1.0, 300, folder, plan)
    assert broken_rules(site) == []
    assert lost(site)
