"""Sizes of a gap in physical units, for the sentence that an engineer reads first."""

from types import SimpleNamespace

import numpy as np
import pytest

from wetwell.services.reports.gap.lead import differences


def test_differences_are_those_of_full_speed_rows_in_units_and_shares():
    frequency_hz = np.array([[0.0, 25.0, 50.0, 50.0, 50.0]])
    is_row = np.array([True, True, True, True, False])
    traces = SimpleNamespace(
        frequency_hz=frequency_hz,
        is_row=is_row,
        signals={
            "flow_m3h": np.array([[9.0, 9.0, 90.0, np.nan, 900.0]]),
            "head_m": np.array([[0.0, 5.0, 22.0, 24.0, 0.0]]),
        },
    )
    predicted = SimpleNamespace(
        signals={"flow_m3h": np.full((1, 5), 100.0), "head_m": np.full((1, 5), 20.0), "power_kw": np.ones((1, 5))}
    )
    found = differences(traces, predicted)
    assert found["flow_m3h"] == pytest.approx((-10.0, -0.1))
    assert found["head_m"] == pytest.approx((3.0, 0.15))
    assert set(found) == {"flow_m3h", "head_m"}
