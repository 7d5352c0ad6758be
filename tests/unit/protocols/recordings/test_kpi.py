"""Figures of a recording against an independent computation with pandas, second by second."""

import json

import numpy as np
import pandas as pd
import pytest

from wetwell.protocols.recordings.kpi import kpis
from wetwell.protocols.recordings.origin import StoredValue
from wetwell.protocols.recordings.recording import Recording, write_recording
from wetwell.protocols.timestamps import NS_PER_S

START_S = 1_735_689_600 + 82_000  # so that a midnight lies inside
PUMPS = (1, 2)


def field_recording(step_s: int, seed: int = 1, hours: int = 5) -> Recording:
    """Rows as they come from the field: runs of the pumps, gaps, missing values, doubles, out of order."""
    rng = np.random.default_rng(seed)
    time_s = START_S + step_s * np.arange(hours * 3600 // step_s)
    keep = rng.random(time_s.size) > 0.02
    for begin in rng.integers(0, time_s.size, 5):
        keep[begin : begin + 40] = False
    rows = np.sort(np.concatenate([np.flatnonzero(keep), rng.choice(np.flatnonzero(keep), 50)]))
    rows[100:200] = rng.permutation(rows[100:200])
    columns = {}
    for pump in PUMPS:
        running = ((time_s // (300 * step_s)) % (pump + 1) == 0).astype(float)
        for name, scale in (("frequency_hz", 50.0), ("power_kw", 18.0), ("flow_m3h", 200.0), ("running", 1.0)):
            values = running * scale * (1.0 if name == "running" else 1 + 0.01 * rng.standard_normal(time_s.size))
            values[rng.random(time_s.size) < 0.01] = np.nan
            columns[f"pump{pump}_{name}"] = values[rows]
    return Recording(time_ns=time_s[rows] * NS_PER_S, columns=columns)


def by_pandas(recording: Recording, max_gap_s: int) -> pd.DataFrame:
    """Each row held second by second up to the next one."""
    frame = pd.DataFrame(dict(recording.columns), index=recording.time_ns // NS_PER_S)
    frame = frame.sort_index(kind="stable")
    frame = frame[~frame.index.duplicated(keep="first")]
    frame["held"] = (-frame.index.to_series().diff(-1)).where(lambda s: s <= max_gap_s, 0).fillna(0) > 0
    for pump in PUMPS:
        flag = frame[f"pump{pump}_running"].fillna((frame[f"pump{pump}_frequency_hz"] > 0).astype(float))
        unknown = frame[f"pump{pump}_running"].isna() & frame[f"pump{pump}_frequency_hz"].isna()
        state = flag.mask(unknown).ffill()
        frame[f"starts{pump}"] = (state.diff() > 0).astype(float)
        frame[f"run{pump}"] = flag.mask(unknown, 0.0)
    seconds = np.arange(frame.index[0], frame.index[-1])
    starts = frame[[f"starts{pump}" for pump in PUMPS]].reindex(seconds).fillna(0.0)
    each = frame.reindex(seconds, method="ffill")
    each = each.mul(each["held"], axis=0).fillna(0.0)
    each[starts.columns] = starts
    each.index = pd.to_datetime(each.index, unit="s", utc=True)
    return each


@pytest.mark.parametrize(("step_s", "max_gap_s"), [(1, 10), (5, 15), (60, 180), (7, 21)])
def test_figures_are_those_of_pandas(step_s: int, max_gap_s: int) -> None:
    recording = field_recording(step_s, hours=5 if step_s < 60 else 60)
    figures = kpis(recording)
    each = by_pandas(recording, max_gap_s)
    hourly, daily = each.resample("h").sum(), each.resample("D").sum()
    assert figures.hour_ns.tolist() == [stamp.value for stamp in hourly.index.as_unit("ns")]
    assert figures.day_ns.tolist() == [stamp.value for stamp in daily.index.as_unit("ns")]
    for row, pump in enumerate(PUMPS):
        for mine, theirs in (
            (figures.hourly_energy_kwh, hourly[f"pump{pump}_power_kw"] / 3600),
            (figures.daily_energy_kwh, daily[f"pump{pump}_power_kw"] / 3600),
            (figures.daily_volume_m3, daily[f"pump{pump}_flow_m3h"] / 3600),
            (figures.daily_run_h, daily[f"run{pump}"] / 3600),
            (figures.daily_starts, daily[f"starts{pump}"]),
        ):
            np.testing.assert_allclose(mine[row], theirs, rtol=1e-9, atol=1e-9)
    assert figures.starts.min() > 0
    np.testing.assert_allclose(figures.cumulative_energy_kwh[:, -1], figures.energy_kwh)
    np.testing.assert_allclose(figures.duty_share.sum(), 1.0)
    np.testing.assert_allclose(figures.daily_known_h, daily["held"] / 3600)


def rows(time_s: list[float], value: StoredValue = "instant", **columns: list[float]) -> Recording:
    stamps_ns = (np.array(time_s) * NS_PER_S).astype(np.int64)
    of_pump = {f"pump1_{name}": np.array(values, dtype=float) for name, values in columns.items()}
    return Recording(time_ns=stamps_ns, columns=of_pump, value=value)


def test_a_gap_counts_nothing() -> None:
    gap = rows([0, 1, 1001, 1002], power_kw=[3600.0] * 4, running=[1.0] * 4, flow_m3h=[3600.0] * 4)
    figures = kpis(gap)
    assert figures.energy_kwh == pytest.approx([2.0])
    assert figures.run_h == pytest.approx([2.0 / 3600.0])
    assert figures.volume_m3 == pytest.approx([2.0])
    assert kpis(gap, max_gap_s=1000.0).energy_kwh == pytest.approx([1002.0])


@pytest.mark.parametrize("period_s", [10, 60, 900])
def test_means_give_the_energy_the_volume_and_the_run_time_of_the_seconds(period_s: int) -> None:
    rng = np.random.default_rng(period_s)
    on = np.repeat(rng.integers(0, 2, 200), rng.integers(100, 900, 200))
    on = np.concatenate([on[: on.size // period_s * period_s], np.zeros(0)])
    power_kw, flow_m3h = on * (10.0 + rng.random(on.size)), on * (200.0 + rng.random(on.size))
    means = {
        name: values.reshape(-1, period_s).mean(axis=1)
        for name, values in (("power_kw", power_kw), ("flow_m3h", flow_m3h), ("running", on))
    }
    ends_s = period_s * np.arange(1, on.size // period_s + 1)
    figures = kpis(rows(ends_s, "mean", **means))
    rest = slice(period_s, None)  # of the first mean nobody knows when it began
    assert figures.energy_kwh == pytest.approx([power_kw[rest].sum() / 3600.0])
    assert figures.volume_m3 == pytest.approx([flow_m3h[rest].sum() / 3600.0])
    assert figures.run_h == pytest.approx([on[rest].sum() / 3600.0])
    assert figures.step_s == period_s


def test_two_parts_of_means_that_share_a_row_add_up() -> None:
    time_s, power_kw = [0, 900, 1800, 2700], [1.0, 2.0, 4.0, 8.0]
    whole = kpis(rows(time_s, "mean", power_kw=power_kw)).energy_kwh
    parts = [kpis(rows(time_s[part], "mean", power_kw=power_kw[part])) for part in (slice(0, 3), slice(2, 4))]
    assert parts[0].energy_kwh + parts[1].energy_kwh == pytest.approx(whole)
    assert whole == pytest.approx([14.0 / 4.0])


def test_frequency_speaks_where_the_flag_does_not() -> None:
    nan = float("nan")
    mixed = rows([0, 1, 2, 3, 4, 5], running=[0, nan, nan, nan, 1, 0], frequency_hz=[50, 0, 50, nan, 0, 50])
    assert kpis(mixed).starts.tolist() == [1]
    assert kpis(mixed).run_h == pytest.approx([2.0 / 3600.0])


def test_what_was_never_measured_is_not_known() -> None:
    figures = kpis(rows([0, 1], running=[1, 1]))
    assert np.isnan(figures.energy_kwh).all()
    assert np.isnan(figures.station_specific_energy_kwh_m3)
    assert figures.run_h == pytest.approx([1.0 / 3600.0])


@pytest.mark.parametrize("count", [0, 1])
def test_no_row_and_one_row(count: int) -> None:
    figures = kpis(rows([0.0] * count, power_kw=[1.0] * count))
    assert np.nansum(figures.hourly_energy_kwh) == 0.0
    assert figures.starts.tolist() == [0]
    assert figures.day_ns.size == count


def test_a_gap_of_no_length_is_refused() -> None:
    with pytest.raises(ValueError, match="max_gap_s must be positive, got 0"):
        kpis(rows([0.0], power_kw=[1.0]), max_gap_s=0.0)


@pytest.mark.parametrize("as_json", [True, False])
def test_the_command_prints_days_and_totals(run_wetwell, tmp_path, capsys, as_json: bool) -> None:
    recording = field_recording(1)
    write_recording(recording, tmp_path / "r.parquet")
    assert run_wetwell("kpi", "--recording", tmp_path / "r.parquet", *(["--json"] if as_json else [])) == 0
    printed = capsys.readouterr().out
    energy_kwh = kpis(recording).energy_kwh
    if as_json:
        shown = json.loads(printed)
        assert [row["energy_kwh"] for row in shown["totals"]] == pytest.approx(energy_kwh.tolist(), abs=1e-3)
        assert len(shown["days"]) == 2 * len(PUMPS)
        assert len(shown["hours"]) == 6
        assert "not_seen" not in shown
    else:
        assert "2025-01-02" in printed
        assert f"{energy_kwh[0]:.2f}"[:-1] in printed


def test_the_command_says_what_a_slow_recording_does_not_show(run_wetwell, tmp_path, capsys) -> None:
    write_recording(field_recording(60), tmp_path / "r.parquet")
    assert run_wetwell("kpi", "--recording", tmp_path / "r.parquet") == 0
    said = "not_seen: starts and stops between two rows, of which there is one in 60 s"
    assert said in capsys.readouterr().out
