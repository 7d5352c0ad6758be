"""Parts of a long recording."""

import numpy as np

from wetwell.sim2real.recording.by_hand import left_alone
from wetwell.sim2real.recording.drives import Drives
from wetwell.sim2real.recording.excerpt import BLANK_S, PART_S, excerpt
from wetwell.sim2real.recording.traces import Traces


def traces(seconds):
    second = np.arange(seconds)
    hz = np.where(second % 600 < 200, 50.0, 0.0)[None, :]
    return Traces(
        start_ns=0,
        rate_s=1.0,
        value="instant",
        time_s=second.astype(float),
        is_row=np.ones(seconds, dtype=bool),
        drives=Drives(frequency_hz=hz, placements=(), open_s=np.zeros_like(hz)),
        level_m=second.astype(float),
        inflow_m3h=None,
        signals={"flow_m3h": 2.0 * hz},
        by_hand=left_alone(seconds),
        part=np.zeros(seconds, dtype=int),
    )


def test_a_short_recording_stays_whole():
    whole = traces(3600)
    assert excerpt(whole, most_s=7200) is whole


def test_parts_keep_their_rows_together_and_spread_over_days_and_hours():
    part = excerpt(traces(26 * 86_400), most_s=172_800)
    is_blank = np.isnan(part.level_m)
    assert part.seconds <= 172_800 + 12 * (BLANK_S + 1200)
    assert np.array_equal(part.level_m[~is_blank], part.time_s[~is_blank])
    begins = np.flatnonzero(~is_blank & np.r_[True, is_blank[:-1]])
    assert begins.size == 172_800 // PART_S
    assert np.ptp(part.time_s[begins]) > 22 * 86_400
    hours = np.sort(part.time_s[begins] % 86_400 / 3600.0)
    assert np.diff(hours, append=hours[0] + 24.0).max() < 8.0


def test_between_parts_nothing_runs_and_time_goes_on():
    part = excerpt(traces(10 * 86_400), most_s=172_800)
    is_blank = np.isnan(part.level_m)
    assert np.all(part.frequency_hz[:, is_blank] == 0.0)
    assert np.isnan(part.signals["flow_m3h"][:, is_blank]).all()
    assert np.all(np.diff(part.time_s) > 0.0)
    edges = np.flatnonzero(np.diff(is_blank.astype(int)))
    assert np.all(part.frequency_hz[0, edges[::2]] == 0.0)
