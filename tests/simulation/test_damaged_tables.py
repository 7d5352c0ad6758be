"""Samples of a history whose tables a disk has mixed up are kept."""

from accidents import Accident
from rules import broken_rules
from site_kinds import light_site


def test_seed_2708890_keeps_the_samples_that_stand_on_a_page_of_hours(folder):
    plan = (
        Accident("misdirected", "historian", 96_393.3, 1.0, seed=568369),
        Accident("kill", "gateway", 97_795.8, 1.0, seed=540832),
        Accident("misdirected", "historian", 100_052.0, 1.0, seed=21798),
    )
    assert broken_rules(light_site(2708890, 1, 2.0, 300, folder, plan)) == []


def test_seed_2708504_keeps_the_samples_of_a_station_whose_name_only_the_index_has(folder):
    plan = (
        Accident("misdirected", "historian", 30_243.6, 1.0, seed=867927),
        Accident("misdirected", "historian", 33_664.8, 1.0, seed=63834),
        Accident("misdirected", "historian", 35_703.4, 1.0, seed=106235),
        Accident("misdirected", "historian", 45_284.1, 1.0, seed=659290),
        Accident("power", "site", 86_780.5, 1.0, seed=257869),
        Accident("power", "site", 97_920.5, 3_698.8, seed=956489),
        Accident("misdirected", "historian", 102_322.1, 1.0, seed=888446),
    )
    assert broken_rules(light_site(2708504, 1, 2.0, 300, folder, plan)) == []
