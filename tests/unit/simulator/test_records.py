"""Every number of a dataclass has its place in the record that compiled code reads, under the name of its field."""

from dataclasses import fields

import numpy as np
import pytest

from wetwell.simulator.effects import effective_parameters
from wetwell.simulator.records import NUMBERS, records_of
from wetwell.simulator.state import ChannelState, PumpState, StationState
from wetwell.simulator.wet_well import ProfileSlice

OTHERWISE = {"profile", "mains", "pumps", "start_levels_m", "stop_levels_m", "sensors", "corrections", "columns"}
"""Fields of the parameters that the kernel gets as arrays of their own."""


def kinds(station):
    parameters = effective_parameters(station)
    states = (StationState(), PumpState(), ChannelState())
    return [
        parameters,
        parameters.mains[0],
        parameters.pumps[0],
        parameters.sensors[0],
        ProfileSlice(1.0, 2.0, 0.5, 3.0),
        *states,
    ]


@pytest.mark.parametrize("number", range(8))
def test_every_field_is_in_the_record(alpha, number):
    thing = kinds(alpha)[number]
    record = np.asarray(records_of([thing]))
    kept = {field.name for field in fields(thing)} - OTHERWISE
    assert set(record.dtype.names) == kept
    for field in fields(thing):
        if field.name in kept:
            assert field.type in NUMBERS
            assert record.dtype[field.name] == np.dtype(field.type)
            np.testing.assert_array_equal(record[field.name], [getattr(thing, field.name)])


def test_a_record_is_a_view():
    pumps = records_of([PumpState(), PumpState()])
    pumps[1]["run_s"] = 7.0
    assert pumps["run_s"].tolist() == [0.0, 7.0]
