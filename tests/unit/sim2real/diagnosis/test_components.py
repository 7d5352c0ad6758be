"""In which component something may be."""

import pytest

from wetwell.sim2real.diagnosis.components import component_probability, place_of_unknown
from wetwell.sim2real.likelihood.posterior import SetProbability, UnknownShare


def answer(probability, verdict, *effects):
    return SetProbability(effects=effects, verdict=verdict, probability=probability)


def way(share, component, *acting):
    return UnknownShare(acting=acting, component=component, share=share)


def test_an_effect_is_in_its_component_and_something_unknown_in_that_of_its_term():
    posterior = [answer(0.7, "unknown"), answer(0.2, "effect", "friction_bias", "pump_wear"), answer(0.1, "none")]
    unknown = [way(0.75, "sump", "friction_bias"), way(0.25, None)]
    found = component_probability(posterior, unknown, "level_sensor")
    assert list(found) == ["rising_main", "sump", "pump", "level_sensor"], "the most probable first"
    assert found["sump"] == pytest.approx(0.7 * 0.75)
    assert found["rising_main"] == pytest.approx(0.7 * 0.75 + 0.2), "beside what is unknown, or alone"
    assert found["level_sensor"] == pytest.approx(0.7 * 0.25), "where the pattern of the readings points"


def test_two_effects_of_a_component_count_once():
    found = component_probability([answer(1.0, "effect", "friction_bias", "static_head_bias")], [], "sump")
    assert found == {"rising_main": 1.0}


@pytest.mark.parametrize(
    ("term", "pattern", "component"),
    [
        ("drive", "drive", "drive"),
        ("drive", "power_meter", "power_meter"),
        ("pump", "drive", "drive"),
        ("pump", "rising_main", "pump"),
        ("drive", "pump", "drive"),
        ("drive", "telemetry", "telemetry"),
        ("sump", "telemetry", "telemetry"),
        ("sump", "level_sensor", "sump"),
    ],
)
def test_where_the_pattern_of_the_readings_tells_more_than_a_term_it_counts(term, pattern, component):
    """The power is drawn by one and read by one; a head is the pump's or the speed's; no term comes late."""
    found = component_probability([answer(1.0, "unknown")], [way(1.0, term)], pattern)
    assert found == {component: 1.0}


def test_of_components_that_are_as_probable_that_of_what_is_unknown_comes_first():
    """Water in a long main has inertia at each such station: no crew goes out for it."""
    found = component_probability([answer(1.0, "unknown")], [way(1.0, "sump", "water_inertia")], "level_sensor")
    assert list(found) == ["sump", "rising_main"]
    assert found == {"sump": 1.0, "rising_main": 1.0}


def test_what_is_unknown_has_a_place_of_its_own_whatever_stands_beside_it():
    """A lag that the library lacks is a late level beside a late controller: both stand in each likely set."""
    posterior = [answer(0.85, "unknown"), answer(0.15, "effect", "channel_delay", "control_delay")]
    unknown = [way(1.0, None, "channel_delay", "control_delay")]
    assert next(iter(component_probability(posterior, unknown, "level_sensor"))) != "level_sensor"
    assert place_of_unknown(unknown, "level_sensor") == "level_sensor"


def test_ways_in_one_place_add_up():
    unknown = [way(0.4, "sump"), way(0.3, "drive", "friction_bias"), way(0.3, "drive")]
    assert place_of_unknown(unknown, "level_sensor") == "drive"
    assert place_of_unknown([], "telemetry") == "telemetry"
