"""Recordings in other units are refused before they are judged; those of faults are not."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.protocols.errors import RecordingError
from wetwell.services.batch.units import refuse_other_units
from wetwell.services.stations import find_scenario
from wetwell.sim2real.replay.units import check_units
from wetwell.simulator.simulation import Simulation

LENGTH_S = 14_400


@pytest.fixture(scope="module")
def rows(alpha):
    return Simulation(alpha, find_scenario("nominal"), 7).advance(LENGTH_S, truth=False)


def scaled(recording, ending, factor, begin=0):
    """The recording with some columns times a factor, from a row on."""
    columns = {
        name: np.where(np.arange(values.size) < begin, values, values * factor) if name.endswith(ending) else values
        for name, values in recording.columns.items()
    }
    return replace(recording, columns=columns)


@pytest.mark.parametrize(
    ("ending", "factor", "message"),
    [
        ("_flow_m3h", 1 / 3.6, "flow_m3h reads 0.27. times what this station gives, as if in L/s: .* a scale of 3.6"),
        ("_flow_m3h", 4.4029, "as if in US gal/min"),
        ("_head_m", 1 / 10.197, "as if in bar: prepare the recording with a scale of 10.2"),
        ("_power_kw", 1000.0, "as if in W"),
        ("level_m", 100.0, "level_m reads .* where the pumps switch at 0.5 to 1.6 m, as if in cm"),
        ("_frequency_hz", 2.0, "as if in % of nominal: prepare the recording with a scale of 0.5"),
        ("_frequency_hz", 1.2, "frequency_hz reads 60, more than 1.15 times nominal_frequency_hz, which is 50"),
    ],
)
@pytest.mark.parametrize("step", [1, 10])
def test_a_unit_is_named(alpha, rows, ending, factor, message, step):
    columns = {name: values[::step] for name, values in rows.columns.items()}
    slower = replace(rows, time_ns=rows.time_ns[::step], columns=columns)
    with pytest.raises(ValueError, match=message):
        check_units(scaled(slower, ending, factor), alpha)


@pytest.mark.parametrize(
    ("ending", "factor", "begin"),
    [("_flow_m3h", 1.0, 0), ("_flow_m3h", 0.5, 0), ("_flow_m3h", 1 / 3.6, LENGTH_S // 2), ("pump1_head_m", 0.1, 0)],
)
def test_what_a_fault_may_do_is_judged(alpha, rows, ending, factor, begin):
    check_units(scaled(rows, ending, factor, begin), alpha)


def test_rows_in_any_order_are_looked_at_and_too_few_are_not(alpha, rows):
    order = np.random.default_rng(1).permutation(len(rows))
    mixed = scaled(rows, "_flow_m3h", 1 / 3.6)
    mixed = replace(
        mixed, time_ns=mixed.time_ns[order], columns={name: values[order] for name, values in mixed.columns.items()}
    )
    with pytest.raises(RecordingError, match=r"field\.csv: flow_m3h reads .* as if in L/s"):
        refuse_other_units(mixed, alpha, "field.csv")
    few = {name: values[:900] for name, values in mixed.columns.items()}
    refuse_other_units(replace(mixed, time_ns=rows.time_ns[:900], columns=few), alpha, "field.csv")
