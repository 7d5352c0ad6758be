"""Rows of means in which a pump may have been switched."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.stream.block import blocks, confirmed_rows, switched_rows
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.stations import find_scenario
from wetwell.simulator.simulation import Simulation

STEP_NS = 900 * NS_PER_S


def stored(value="mean", time=None, **columns):
    rows = len(next(iter(columns.values())))
    time_ns = STEP_NS * (np.arange(rows) if time is None else np.array(time))
    return Recording(time_ns=time_ns, columns={k: np.array(v, dtype=float) for k, v in columns.items()}, value=value)


def of_pump(pump, recording):
    return switched_rows(recording, max(pump, recording.pumps))[:, pump - 1].astype(int).tolist()


def test_rows_of_a_start_and_of_a_stop_are_switched_and_those_between_are_not():
    assert of_pump(1, stored(pump1_frequency_hz=[0, 20, 50, 50, 50, 10, 0, 0])) == [0, 1, 0, 0, 0, 1, 0, 0]


def test_each_pump_has_rows_of_its_own_and_none_where_it_has_no_column():
    rows = stored(pump1_frequency_hz=[50] * 5, pump2_frequency_hz=[0, 30, 50, 20, 0])
    assert of_pump(1, rows) == [1, 0, 0, 0, 1]  # nobody knows what was before and after
    assert of_pump(2, rows) == [0, 1, 0, 1, 0]
    assert of_pump(3, rows) == [0] * 5


def test_the_flag_counts_before_the_frequency_and_that_before_the_flow():
    rows = {"pump1_running": [1, 1, 1, np.nan, 1], "pump1_frequency_hz": [0, 0, 0, 50, 0], "pump1_flow_m3h": [0] * 5}
    assert of_pump(1, stored(**rows)) == [1, 0, 0, 0, 1]
    assert of_pump(1, stored(pump1_flow_m3h=[9, 9, 9, 0])) == [1, 0, 1, 0]


def test_a_missing_row_leaves_its_neighbours_open():
    assert of_pump(1, stored(time=[0, 1, 2, 4, 5, 6], pump1_frequency_hz=[50] * 6)) == [1, 0, 1, 1, 0, 1]


def test_rows_out_of_order_are_told_by_their_stamps():
    assert of_pump(1, stored(time=[0, 2, 1, 3], pump1_frequency_hz=[0, 50, 50, 50])) == [0, 0, 1, 1]


@pytest.mark.parametrize("value", ["instant", "held"])
def test_only_means_have_such_rows(value):
    assert not switched_rows(stored(value, pump1_frequency_hz=[0, 50, 50, 0]), 1).any()
    assert not next(blocks(stored(value, pump1_frequency_hz=[0, 50, 50, 0]), 1)).is_switched.any()


def test_blocks_hand_them_on():
    (block,) = blocks(stored(pump1_frequency_hz=[0, 50, 50, 50, 0]), 1)
    assert block.is_switched[:, 0].astype(int).tolist() == [0, 1, 0, 1, 0]


def test_rows_confirm_one_that_none_of_the_next_lies_before():
    time_s = [0, 1, 7200, 2, 3, 9000, 9001, 9001]
    assert confirmed_rows(np.array(time_s)).astype(int).tolist() == [1, 1, 0, 1, 1, 1, 1, 0]
    assert confirmed_rows(np.array([5])).tolist() == [False]
    assert confirmed_rows(np.zeros(0, dtype=np.int64)).tolist() == []


@pytest.mark.parametrize("lost_s", [1, 1800, 7200, 14 * 86_400])
def test_all_rows_behind_a_gap_of_a_recording_count_and_no_clock_was_set(alpha, lost_s):
    recording = Simulation(alpha, find_scenario("demo"), 3).advance(4 * 3600)
    time_ns = recording.time_ns + lost_s * NS_PER_S * (np.arange(len(recording)) >= 5000)
    time_ns[9000] += 86_400 * NS_PER_S
    detector = Detector.of(alpha)
    detector.judge(replace(recording, time_ns=time_ns))
    assert detector.counts == {"samples": len(recording), "future": 1} | ({"gaps": 1} if lost_s > 1 else {})


def test_a_block_cut_out_of_a_larger_table_is_judged_as_one_that_stands_alone(alpha):
    recording = Simulation(alpha, find_scenario("demo"), 3).advance(4 * 3600)
    datasheet = datasheet_of(alpha)
    alone, cut_out = Detector("alpha", datasheet), Detector("alpha", datasheet)
    for block in blocks(recording, datasheet.pumps):
        wide = np.zeros((len(block.seq), 2 * block.values.shape[1]))
        wide[:, ::2] = block.values
        other = block._replace(values=wide[:, ::2], time_ns=np.repeat(block.time_ns, 2)[::2])
        assert cut_out.update_block(other) == alone.update_block(block)
    assert cut_out.counts == alone.counts
    assert cut_out.snapshot() == alone.snapshot()
