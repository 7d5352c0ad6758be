"""Sampled items: balanced, reproducible, valid, and what they claim to be."""

import tomllib
from collections import Counter

import pytest
import tomli_w

from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import LEARNING_S
from wetwell.services.batch.dataset import check_dataset, plan_of
from wetwell.services.stations import find_station
from wetwell.simulator.dataset import MAX_PUMPS, item_of, kinds_of, labels
from wetwell.simulator.faults import FAULTS
from wetwell.simulator.faults.profile import PumpFault, SensorFault
from wetwell.simulator.scenario import Scenario

DAY_S = 86_400


@pytest.fixture(scope="module")
def items(alpha):
    return [item_of([alpha], 1, number, DAY_S) for number in range(120)]


def test_classes_and_kinds_are_balanced(items) -> None:
    counts = Counter(item.label for item in items)
    assert set(counts) == set(labels())
    assert max(counts.values()) - min(counts.values()) <= 1
    for label in labels():
        kinds = Counter(tuple(f.kind for f in item.scenario.fault) for item in items if item.label == label)
        assert set(kinds) <= set(kinds_of(label))
        assert max(kinds.values()) - min(kinds.values()) <= 1


def test_every_kind_of_fault_can_be_sampled(alpha) -> None:
    number = len(labels()) * max(len(kinds_of(label)) for label in labels())
    seen = {f.kind for k in range(number) for f in item_of([alpha], 3, k, DAY_S).scenario.fault}
    assert seen == set(FAULTS)


def test_faults_are_those_of_the_label_and_begin_after_learning(items) -> None:
    for item in items:
        kinds = [type(fault) for fault in item.scenario.fault]
        hydraulic = {
            ("pump" if issubclass(k, PumpFault) else "system") for k in kinds if not issubclass(k, SensorFault)
        }
        expected = {
            "normal": set(),
            "sensor_fault": set(),
            "pump_fault": {"pump"},
            "system_fault": {"system"},
            "pump_and_system_fault": {"pump", "system"},
        }
        assert hydraulic == expected[item.label]
        assert all(LEARNING_S <= f.start_s < f.end_s <= 2 * DAY_S for f in item.scenario.fault)
        assert all(f.start_s < DAY_S for f in item.scenario.fault)
        if item.label == "pump_and_system_fault":
            one, other = item.scenario.fault
            assert other.start_s < one.end_s


def test_stations_and_scenarios_survive_their_files(items) -> None:
    for item in items:
        for table, model in ((item.station, Station), (item.scenario, Scenario)):
            text = tomli_w.dumps(table.model_dump(mode="json", exclude_none=True))
            assert model.model_validate(tomllib.loads(text)) == table
    assert {len(item.station.pump) for item in items} == set(range(1, MAX_PUMPS + 1))
    assert {item.station.rising_main.layout for item in items} == {"individual", "common"}
    assert len({item.scenario.inflow.kind for item in items}) > 1
    assert len({item.seed for item in items}) == len(items)


def test_an_item_depends_on_seed_and_number_only(alpha, items) -> None:
    assert item_of([alpha], 1, 77, DAY_S) == items[77]
    assert item_of([alpha], 2, 77, DAY_S).station != items[77].station


def test_a_base_with_one_pump_profile_and_effect_can_be_perturbed() -> None:
    base = Station.model_validate(
        {
            "name": "n" * 64,
            "sump": {"area_m2": 4.0, "profile": [[0.0, 2.0], [2.0, 4.0]]},
            "pump": [{"points": [[0, 20], [50, 16], [100, 6]]}],
            "control": {"start_levels_m": [1.5], "stop_levels_m": [0.6], "out_of_service": []},
            "effect": [{"name": "friction_bias", "factor": 1.2}],
        }
    )
    for number in range(30):
        station = item_of([base], 1, number, DAY_S).station
        assert len(station.control.start_levels_m) == len(station.pump)
        assert station.effect == base.effect


def test_too_short_a_recording_is_refused(alpha) -> None:
    with pytest.raises(ConfigError, match=r"an item must be at least 0\.292 days long, got 0\.200"):
        plan_of([alpha], 1, 1, 0.2, "parquet")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[", "is not JSON"),
        ("[]", "is not a manifest"),
        ('{"schema": "wetwell.dataset/1", "items": [{}]}', "is not a manifest"),
        ('{"schema": "wetwell.dataset/9", "items": []}', "is not a manifest"),
    ],
)
def test_a_bad_manifest_is_refused(tmp_path, text: str, said: str) -> None:
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(RecordingError, match=said):
        check_dataset(tmp_path)


def test_stations_with_several_mains_are_sampled_and_external_ones_refused() -> None:
    """Mains without a pump in the draw are left out; what is left is a station again, written and read."""
    twin = find_station("twin")
    items = [item_of([twin], 4, number, DAY_S) for number in range(24)]
    assert {len(item.station.mains) for item in items} == {1, 2}
    for item in items:
        station = item.station
        assert {pump.main for pump in station.pump} == {main.name for main in station.mains}
        assert all(main.delivery_level_m is not None for main in station.mains)
        assert station.sump.volume_points is not None
        text = tomli_w.dumps(station.model_dump(exclude_none=True))
        assert Station.model_validate(tomllib.loads(text)) == station
    external = Station.model_validate(twin.model_dump(exclude_none=True) | {"control": {"mode": "external"}})
    with pytest.raises(ValueError, match="'external': nobody knows when pumps start"):
        item_of([external], 4, 0, DAY_S)
