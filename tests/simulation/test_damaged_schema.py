"""Rows of a history whose schema a disk has changed are read by the schema that was made."""

from accidents import Accident
from rules import broken_rules
from site_kinds import light_site


def test_seed_2707788_keeps_the_samples_of_stations_that_seem_to_have_a_column_less(folder):
    plan = (Accident("rot", "historian", 48_058.1, 1.0, seed=582408),)
    assert broken_rules(light_site(2707788, 1, 2.0, 300, folder, plan)) == []
