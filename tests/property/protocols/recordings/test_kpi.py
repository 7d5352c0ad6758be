"""What holds for the figures of every recording."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from wetwell.protocols.recordings.kpi import Kpis, kpis
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S

MAX_GAP_S = 30.0
VALUE = st.one_of(st.just(float("nan")), st.floats(-50.0, 200.0))


@st.composite
def recordings(draw: st.DrawFn) -> Recording:
    count = draw(st.integers(1, 60))
    steps_s = draw(st.lists(st.sampled_from([0, 1, 1, 1, 7, 30, 31, 4000]), min_size=count, max_size=count))
    time_ns = NS_PER_S * (1_735_689_600 + 3500 + np.cumsum(steps_s))
    columns = {
        f"pump{pump}_{name}": np.array(draw(st.lists(VALUE, min_size=count, max_size=count)))
        for pump in (1, 2)
        for name in ("power_kw", "flow_m3h", "frequency_hz")
    }
    return Recording(time_ns=time_ns.astype(np.int64), columns=columns)


def part(recording: Recording, chosen: np.ndarray) -> Recording:
    return Recording(
        time_ns=recording.time_ns[chosen], columns={name: v[chosen] for name, v in recording.columns.items()}
    )


def amounts(figures: Kpis) -> np.ndarray:
    return np.nan_to_num(np.array([figures.energy_kwh, figures.volume_m3, figures.run_h]))


@given(recordings())
def test_nothing_is_negative_and_hours_add_up_to_days(recording: Recording) -> None:
    figures = kpis(recording, MAX_GAP_S)
    for values in (figures.hourly_energy_kwh, figures.daily_volume_m3, figures.daily_run_h, figures.daily_starts):
        assert not np.any(values < 0)
    np.testing.assert_allclose(figures.hourly_energy_kwh.sum(axis=1), figures.energy_kwh, rtol=1e-12)
    assert np.all(np.nan_to_num(figures.daily_run_h) <= figures.daily_known_h + 1e-12)


@given(recordings(), st.data())
def test_parts_that_share_the_row_of_the_cut_add_up(recording: Recording, data: st.DataObject) -> None:
    cut_ns = data.draw(st.sampled_from(recording.time_ns.tolist()))
    whole = kpis(recording, MAX_GAP_S)
    halves = [
        kpis(part(recording, chosen), MAX_GAP_S)
        for chosen in (recording.time_ns <= cut_ns, recording.time_ns >= cut_ns)
    ]
    np.testing.assert_allclose(sum(map(amounts, halves)), amounts(whole), rtol=1e-9, atol=1e-12)
    row = np.flatnonzero(recording.time_ns == cut_ns)[0]
    for pump, frequency_hz in enumerate(recording.column(f"pump{p}_frequency_hz") for p in (1, 2)):
        if np.isfinite(frequency_hz[row]):  # else the second part does not know the state at its beginning
            assert sum(half.starts[pump] for half in halves) == whole.starts[pump]


@given(recordings(), st.randoms(use_true_random=False))
def test_order_and_doubles_do_not_matter(recording: Recording, random) -> None:
    rows = np.unique(recording.time_ns, return_index=True)[1]
    clean = part(recording, rows)
    order = [*range(len(clean)), *range(0, len(clean), 3)]
    random.shuffle(order)
    mixed, plain = kpis(part(clean, np.array(order)), MAX_GAP_S), kpis(clean, MAX_GAP_S)
    np.testing.assert_array_equal(mixed.hourly_energy_kwh, plain.hourly_energy_kwh)
    np.testing.assert_array_equal(mixed.daily_starts, plain.daily_starts)
