"""The one list of what is measured, and the records that have a field for each."""

from typing import get_args, get_type_hints

import numpy as np
import pytest

from wetwell.protocols import quantities as q
from wetwell.protocols.messages.readings import PumpRow, Row, row_values
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.sample_block import PumpBlock, SampleBlock
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.units import house_unit


def test_the_order_of_a_row_is_that_of_files_and_stores_since_ever():
    assert q.columns_of(2) == (
        "level_m",
        "inflow_m3h",
        "pump1_frequency_hz",
        "pump1_flow_m3h",
        "pump1_head_m",
        "pump1_power_kw",
        "pump1_running",
        "pump2_frequency_hz",
        "pump2_flow_m3h",
        "pump2_head_m",
        "pump2_power_kw",
        "pump2_running",
    )


def test_places_of_compiled_code_are_those_of_the_names():
    columns = q.columns_of(1)
    assert [columns[place] for place in (q.LEVEL, q.INFLOW)] == ["level_m", "inflow_m3h"]
    of_pump = [columns[q.FIRST_PUMP + place] for place in (q.FREQUENCY, q.FLOW, q.HEAD, q.POWER, q.RUNNING)]
    assert of_pump == [
        q.pump_column(1, name) for name in ("frequency_hz", "flow_m3h", "head_m", "power_kw", "running")
    ]
    assert len(columns) == q.FIRST_PUMP + q.PUMP_VALUES


def test_types_and_lists_name_the_same():
    assert get_args(q.AnalogueQuantity) == (*q.STATION_QUANTITIES, *q.PUMP_ANALOGUES)
    assert get_args(q.SensedQuantity) == (*q.STATION_QUANTITIES, *q.PUMP_METERS)
    assert q.PUMP_METERS == ("flow_m3h", "head_m", "power_kw")


@pytest.mark.parametrize("pump", [PumpReading, PumpBlock, PumpRow])
def test_records_of_a_pump_have_the_fields_of_the_list(pump):
    assert list(get_type_hints(pump))[-len(q.PUMP_QUANTITIES) :] == list(q.PUMP_QUANTITIES)


@pytest.mark.parametrize("station", [Sample, SampleBlock, Row])
def test_records_of_a_station_have_the_fields_of_the_list(station):
    assert [name for name in get_type_hints(station) if name in q.STATION_QUANTITIES] == list(q.STATION_QUANTITIES)


def test_units_are_those_that_the_names_say():
    for name, quantity in (q.STATION_QUANTITIES | q.PUMP_QUANTITIES).items():
        assert quantity.unit == house_unit(name)


def test_a_row_of_a_recording_has_its_values_in_order():
    columns = {name: np.array([float(place)]) for place, name in enumerate(q.columns_of(2), start=1)}
    (row,) = Recording(time_ns=np.array([0]), columns=columns).rows()
    assert row_values(row) == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, True, 8.0, 9.0, 10.0, 11.0, True]
    assert q.pumps_of_width(len(row_values(row))) == q.pumps_of(columns) == 2


def test_a_recording_gives_a_quantity_of_all_pumps():
    recording = Recording(time_ns=np.array([0, 1]), columns={"pump2_head_m": np.array([1.0, 2.0])})
    np.testing.assert_array_equal(recording.of_pumps("head_m"), [[np.nan, np.nan], [1.0, 2.0]])
    assert recording.of_pumps("head_m", 3).shape == (3, 2)
    assert Recording(time_ns=np.array([0, 1]), columns={}).of_pumps("head_m").shape == (0, 2)
