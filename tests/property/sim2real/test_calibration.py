"""Calibration takes whatever a historian holds: gaps, dead channels, constants, contradictions."""

from dataclasses import replace
from functools import cache

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from two_mains import recording, station, truth

from wetwell.sim2real.calibration.calibration import calibrate
from wetwell.sim2real.calibration.comparison import compare
from wetwell.sim2real.calibration.fitted_station import with_estimates

ROWS = 240
VALUES = {"gap": np.nan, "constant": 7.0, "zero": 0.0, "negative": -40.0, "huge": 1e9}


@cache
def five_days():
    rng = np.random.default_rng(3)
    return recording(rng, truth(rng), days=5.0, step_s=1800)


spoilings = st.lists(
    st.tuples(
        st.sampled_from([*VALUES, "absent", "turned"]),
        st.integers(0, 18),
        st.integers(0, ROWS - 1),
        st.integers(1, ROWS),
    ),
    max_size=12,
)


@settings(max_examples=40)
@given(spoilings=spoilings, seed=st.integers(0, 1000), share=st.sampled_from([1.0, 0.9, 0.3, 0.0]))
def test_it_ends_with_a_station_whatever_the_columns_hold(spoilings, seed, share):
    columns = {name: values.copy() for name, values in five_days().columns.items()}
    names = sorted(columns)
    for kind, place, begin, length in spoilings:
        name, rows = names[place % len(names)], slice(begin, begin + length)
        if name not in columns:
            continue
        if kind == "absent":
            del columns[name]
        elif kind == "turned":
            columns[name][rows] = columns[name][rows][::-1]
        else:
            columns[name][rows] = VALUES[kind]
    kept = np.random.default_rng(seed).random(ROWS) < share
    spoiled = replace(
        five_days(), time_ns=five_days().time_ns[kept], columns={k: v[kept] for k, v in columns.items()}
    )
    estimates = calibrate(spoiled, station())
    for one in estimates:
        assert np.isfinite(one.value)
        assert one.reason or one.interval is not None
        assert one.interval is None or one.interval[0] <= one.interval[1]
    fitted = with_estimates(station(), estimates)
    if spoiled.pumps == len(fitted.pump):
        assert compare(spoiled, fitted).errors("flow_m3h")[0].rows <= 6 * ROWS
