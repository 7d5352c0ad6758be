"""State of the page: what frames and states hold, what is dropped, what is new."""

import json

import pytest

from wetwell.detector.verdict.station_model import StationModel
from wetwell.protocols.bus.interface import Presence
from wetwell.protocols.messages.alarm import Alarm
from wetwell.protocols.messages.history import History
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.messages.status import Status
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.dashboard.view.sample_row import past_rows, sample_row, thinned
from wetwell.services.dashboard.view.site_view import ROWS, SiteView
from wetwell.services.dashboard.view.station_view import LATE_SAMPLES, ROWS_A_FRAME
from wetwell.services.stations import find_station


def sample(second, station="alpha", *, level_m=1.0, running=True):
    pump = PumpReading(frequency_hz=50.0, flow_m3h=200.0, head_m=26.0, power_kw=18.0, running=running)
    rest = PumpReading(frequency_hz=0.0, flow_m3h=0.0, head_m=None, power_kw=0.5, running=False)
    return Sample(station=station, seq=second, time=second * NS_PER_S, level_m=level_m, pumps=(pump, rest))


def verdict(second, state="normal", pump=1, station="alpha"):
    return Verdict(
        time=second * NS_PER_S,
        station=station,
        pump=pump,
        state=state,
        probability={state: 1.0},
        evidence={},
        window=(0, second * NS_PER_S),
    )


def alarm(state="unacknowledged"):
    return Alarm(
        id="pump1.pump_fault",
        time=0,
        station="alpha",
        pump=1,
        priority="high",
        state=state,
        is_active=True,
        text="pump 1: pump fault",
    )


@pytest.fixture
def view():
    site = SiteView(stale_s=10.0)
    site.advance(0.0)
    return site


def test_of_many_samples_only_those_that_are_drawn_are_read_and_none_counts_as_lost(view):
    payloads = [sample(second).encode() for second in range(1, 301)]
    payloads[5] = b"this one is never read"
    view.handle_samples(payloads[:150])
    view.handle_samples(payloads[150:])
    frame = frame_of(view, 0.25)
    assert len(frame["rows"]) == 2 * ROWS_A_FRAME
    assert frame["rows"][-1][0] == 300_000
    assert (frame["lost"], view.counts["malformed"]) == (0, 0)
    view.handle_samples([sample(second).encode() for second in range(311, 315)])
    assert frame_of(view, 0.5)["lost"] == 10


def test_names_that_somebody_makes_up_have_a_bound(view, monkeypatch):
    monkeypatch.setattr("wetwell.services.dashboard.view.site_view.MOST_STATIONS", 3)
    for number in range(10):
        view.handle_sample(sample(1, f"s{number}").encode())
        view.handle_presence(Presence(f"wetwell/p{number}/alive/detector", is_alive=True))
    assert sorted(view.stations) == ["p0", "s0", "s1"]
    view.handle_sample(sample(2, "s1").encode())
    assert view.stations["s1"].sample.seq == 2


SIMULATOR = {"time": 0, "station": "alpha", "service": "simulator", "state": "running"}
ALIVE = "wetwell/alpha/alive/simulator"


@pytest.fixture
def held(view):
    """A plant that is held, and is not missed."""
    view.handle_presence(Presence(ALIVE, is_alive=True))
    view.handle_sample(sample(1).encode())
    view.handle_status(Status(**SIMULATOR, figures={"held": 1.0}).encode())
    assert frame_of(view, 100.0)["stale"] is False
    return view


def test_a_plant_that_is_held_has_not_lost_its_samples(held):
    held.handle_status(Status(**SIMULATOR, figures={"held": 0.0}).encode())
    assert frame_of(held, 120.0)["stale"] is True


def test_a_fault_of_the_main_ends_with_the_newest_verdict_on_it(view):
    """Not with the last one on a pump that does not run any more."""
    station = view.station_state

    def overview():
        return json.loads(view.site_state())["stations"]["0"]

    view.handle_sample(sample(1).encode())
    view.handle_verdict(verdict(1, "system_fault", pump=1).encode())
    view.handle_verdict(verdict(2, "system_fault", pump=2).encode())
    frame_of(view, 1.0)
    assert (overview()["pumps"], overview()["cause"]["since_ms"]) == (["system_fault"] * 2, 2000)
    view.handle_verdict(verdict(3, "unknown", pump=2).encode())
    frame_of(view, 2.0)
    assert (overview()["pumps"], overview()["cause"]["asset"]) == (["system_fault", "unknown"], "main")
    view.handle_verdict(verdict(4, "normal", pump=2).encode())
    frame_of(view, 3.0)
    assert (overview()["state"], overview()["pumps"], overview()["cause"]) == ("normal", ["normal"] * 2, None)
    assert json.loads(station("alpha"))["state"] == "normal"


def test_a_plant_that_was_held_and_has_died_has_lost_its_samples(held):
    held.handle_presence(Presence(ALIVE, is_alive=False))
    assert frame_of(held, 120.0)["stale"] is True


def frame_of(view, now_s, station="alpha"):
    return json.loads(view.advance(now_s)[station])


def test_a_frame_holds_the_new_samples_and_then_no_more(view) -> None:
    view.handle_sample(sample(1, level_m=1.25).encode())
    frame = frame_of(view, 0.25)
    assert frame["rows"] == [[1000, 1.25, None, 50, 200, 26, 18, 0, 0, None, 0.5]]
    assert frame["running"] == [True, False]
    assert frame["quality"] == "good"
    assert not frame["stale"]
    assert view.advance(0.5) == {}


def test_many_samples_are_thinned_and_the_last_one_stays(view) -> None:
    view.handle_sample(sample(0).encode())
    view.advance(0.25)
    for second in range(1, 100):
        view.handle_sample(sample(second).encode())
    times_ms = [row[0] for row in frame_of(view, 0.5)["rows"]]
    assert len(times_ms) == ROWS_A_FRAME
    assert times_ms[-1] == 99_000
    assert times_ms == sorted(times_ms)


@pytest.mark.parametrize("size", [1, 10, 60, 600])
def test_the_chart_keeps_of_a_station_in_real_time_each_sample_however_many_come_in_a_message(view, size) -> None:
    for frame in range(1, 4 * 600 + 1):
        second, rest = divmod(frame, 4)
        if rest == 0 and second % size == 0:
            view.handle_sample_block(
                SampleBlock.of([sample(number) for number in range(second - size, second)]).encode()
            )
        view.advance(frame / 4.0)
    rows = json.loads(view.station_state("alpha"))["rows"]
    assert [row[0] for row in rows] == [1000 * second for second in range(600)]


@pytest.mark.parametrize("size", [25, 100, 600])
def test_of_a_station_that_runs_faster_than_life_as_many_samples_are_drawn_from_blocks_as_one_by_one(view, size):
    for frame in range(1, 73):  # a hundred samples a second
        if frame * 25 % size == 0:
            block = [sample(number) for number in range(frame * 25 - size, frame * 25)]
            view.handle_sample_block(SampleBlock.of(block).encode())
        view.advance(frame / 4.0)
    first = min(size, view.stations["alpha"].kept_rows)
    rows = json.loads(view.station_state("alpha"))["rows"]
    assert len(rows) == first + (72 - size // 25) * ROWS_A_FRAME


def test_a_block_that_comes_by_two_ways_is_taken_once(view) -> None:
    block = SampleBlock.of([sample(second) for second in range(300)]).encode()
    for now_s in (0.25, 0.5):
        view.handle_sample_block(block)
        view.advance(now_s)
    state = json.loads(view.station_state("alpha"))
    assert [row[0] for row in state["rows"]] == [1000 * second for second in range(300)]


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 1000])
def test_thinned_keeps_order_and_last(count) -> None:
    samples = [sample(second) for second in range(count)]
    kept = thinned(samples, 8)
    assert len(kept) == min(count, 8)
    assert kept[-1:] == samples[-1:]
    assert [each.seq for each in kept] == sorted({each.seq for each in kept})


def test_a_state_is_the_sum_of_the_frames(view) -> None:
    for second in range(1, 4):
        view.handle_sample(sample(second).encode())
        view.handle_verdict(verdict(second).encode())
        view.advance(float(second))
    state = json.loads(view.station_state("alpha"))
    assert [row[0] for row in state["rows"]] == [1000, 2000, 3000]
    assert [told["time"] for told in state["verdicts"]] == [f"1970-01-01T00:00:0{second}Z" for second in (1, 2, 3)]
    assert state["id"] == view.frame_id


def test_samples_that_come_again_are_dropped_and_a_source_that_begins_anew_is_followed(view) -> None:
    for second in (500, 501, 500, 501):
        view.handle_sample(sample(second).encode())
    assert len(frame_of(view, 0.25)["rows"]) == 2
    for second in range(LATE_SAMPLES):
        view.handle_sample(sample(second).encode())
    frame = frame_of(view, 0.5)
    assert frame["begins"]
    assert [row[0] for row in frame["rows"]] == [117_000, 118_000, 119_000]


def test_the_past_goes_before_what_was_heard_as_far_as_there_is_room(view) -> None:
    for second in (500, 501):
        view.handle_sample(sample(second).encode())
    view.advance(0.25)
    station = view.stations["alpha"]
    station.kept_rows = 5
    assert station.room == 3
    assert station.prepend([f"[{second}]" for second in range(10)], station.first_ns)
    rows = json.loads(view.station_state("alpha"))["rows"]
    assert [row[0] for row in rows] == [7, 8, 9, 500_000, 501_000]
    assert station.prepend(["[6]"], station.first_ns)
    assert json.loads(view.station_state("alpha"))["rows"] == rows


def test_a_past_that_comes_after_the_source_has_begun_anew_is_left_out(view) -> None:
    view.handle_sample(sample(500).encode())
    station = view.stations["alpha"]
    first_ns = station.first_ns
    for second in range(LATE_SAMPLES):
        view.handle_sample(sample(second).encode())
    view.advance(0.25)
    assert station.first_ns == (LATE_SAMPLES - 1) * NS_PER_S
    assert not station.prepend(["[0]"], first_ns)
    assert len(json.loads(view.station_state("alpha"))["rows"]) == 1


def test_rows_of_the_past_are_like_those_of_samples() -> None:
    heard = sample(7)
    pumps = {
        f"pump{place}_{name}": (getattr(pump, name),)
        for place, pump in enumerate(heard.pumps, start=1)
        for name in ("frequency_hz", "flow_m3h", "head_m", "power_kw")
    }
    told = History(station="alpha", kind="samples", time=(heard.time,), columns={"level_m": (1.0,)} | pumps)
    assert past_rows(told) == [sample_row(heard)]


def test_a_ragged_answer_of_a_stranger_harms_nothing() -> None:
    told = History(
        station="a", kind="samples", time=(0, 1, 2), columns={"level_m": (1.0, None), "x_frequency_hz": ()}
    )
    assert [json.loads(row)[1] for row in past_rows(told)] == [1.0, None]


def test_a_verdict_that_comes_again_counts_once(view) -> None:
    for _ in range(2):
        view.handle_verdict(verdict(1).encode())
    assert len(frame_of(view, 0.25)["verdicts"]) == 1


def test_lost_samples_are_counted_by_their_numbers(view) -> None:
    for second in (1, 2, 6):
        view.handle_sample(sample(second).encode())
    assert frame_of(view, 0.25)["lost"] == 3


def test_silence_becomes_no_data_and_ends_with_the_next_sample(view) -> None:
    view.handle_sample(sample(1).encode())
    view.handle_verdict(verdict(1).encode())
    assert frame_of(view, 0.25)["state"] == "normal"
    silent = frame_of(view, 20.0)
    assert (silent["state"], silent["stale"]) == ("no_data", True)
    view.handle_sample(sample(2).encode())
    assert frame_of(view, 20.25)["state"] == "normal"


def test_the_worst_pump_counts_and_without_samples_it_is_no_data_whatever_was_said(view) -> None:
    view.handle_verdict(verdict(1, "pump_fault", pump=2).encode())
    view.handle_verdict(verdict(1, "normal", pump=1).encode())
    view.handle_sample(sample(1).encode())
    assert frame_of(view, 0.25)["state"] == "pump_fault"
    assert frame_of(view, 20.0)["state"] == "no_data"


def test_a_sample_of_unknown_age_is_old_until_another_comes(view) -> None:
    view.handle_sample(sample(1).encode(), is_kept=True)
    frame = frame_of(view, 0.25)
    assert (frame["stale"], frame["age_s"]) == (True, None)
    view.handle_sample(sample(2).encode())
    frame = frame_of(view, 0.5)
    assert not frame["stale"]
    assert frame["age_s"] < 1.0


def test_the_age_of_samples_goes_on_with_the_clock(view) -> None:
    view.handle_sample(sample(1).encode())
    view.advance(0.25)
    view.advance(30.0)
    assert json.loads(view.station_state("alpha"))["age_s"] == 30.0


def test_a_station_of_which_nothing_was_heard_is_none(view) -> None:
    assert view.station_state("alpha") is None
    assert json.loads(view.empty_state("alpha"))["quality"] is None
    view.handle_presence(Presence("wetwell/alpha/alive/detector", is_alive=True))
    assert view.station_state("alpha") is not None


def test_every_station_learns_which_services_of_the_site_live(view) -> None:
    view.handle_sample(sample(1).encode())
    view.advance(0.25)
    view.handle_presence(Presence("wetwell/_site/alive/historian", is_alive=True))
    assert frame_of(view, 0.5)["site"] == ["historian"]
    view.handle_presence(Presence("wetwell/_site/alive/historian", is_alive=False))
    assert frame_of(view, 0.75)["site"] == []
    view.handle_presence(Presence("wetwell/_site/alive/alarms", is_alive=True))
    view.handle_sample(sample(1, "beta").encode())
    view.advance(1.0)
    assert json.loads(view.station_state("beta"))["site"] == ["alarms"]


def test_the_overview_sends_what_has_changed_only(view) -> None:
    view.handle_sample(sample(1).encode())
    view.handle_sample(sample(1, "beta").encode())
    view.advance(0.25)
    first = json.loads(view.site_frame())
    assert [station["name"] for station in first["stations"].values()] == ["alpha", "beta"]
    assert view.site_frame() is None
    view.handle_sample(sample(2, "beta").encode())
    view.advance(0.5)
    second = json.loads(view.site_frame())
    assert second == {"id": view.frame_id, "live": [[1, 2000, 1, 200, 18.5, [1]]], "stations": {}}


def test_the_overview_knows_the_names_of_the_pumps(view) -> None:
    view.handle_model(StationModel(find_station("twin")).message((None,) * 4, {}, 0).encode())
    view.advance(0.25)
    summary = json.loads(view.site_state())["stations"]["0"]
    assert summary["names"] == ["1.1", "2.1", "1.2", "2.2"]
    assert summary["floor"] == pytest.approx(-2.0 - 5.0 / 9.0)


def test_alarms_count_until_they_are_normal(view) -> None:
    view.handle_alarm(alarm().encode())
    view.advance(0.25)
    summary = json.loads(view.site_state())["stations"]["0"]
    assert (summary["alarms"], summary["unacknowledged"]) == (1, 1)
    assert [each["id"] for each in json.loads(view.alarms())] == ["pump1.pump_fault"]
    view.handle_alarm(alarm("normal").encode())
    assert json.loads(view.alarms()) == []


def test_services_are_there_until_they_are_gone(view) -> None:
    view.handle_presence(Presence("wetwell/alpha/alive/detector", is_alive=True))
    view.handle_status(
        Status(time=0, station="alpha", service="detector", state="running", figures={"samples": 3.0}).encode()
    )
    view.handle_presence(Presence("wetwell/_site/alive/historian", is_alive=True))
    assert frame_of(view, 0.25)["alive"] == ["detector"]
    view.handle_presence(Presence("wetwell/alpha/alive/detector", is_alive=False))
    assert frame_of(view, 0.5)["alive"] == []
    health = {service["service"]: service for service in view.health(3.0)}
    assert not health["detector"]["is_alive"]
    assert health["detector"]["age_s"] == 3.0
    assert health["historian"] == {"station": "_site", "service": "historian", "is_alive": True, "age_s": None}
    assert list(view.stations) == ["alpha"]


def test_what_is_no_message_is_counted_and_harms_nothing(view) -> None:
    for take in (view.handle_sample, view.handle_verdict, view.handle_model, view.handle_alarm, view.handle_status):
        take(b"{}")
        take(b"\xff")
    assert view.counts["malformed"] == 10
    assert view.stations == {}


def test_values_that_are_none_stay_none() -> None:
    lost = Sample(station="a", seq=0, time=0, level_m=float("nan"), pumps=(PumpReading(flow_m3h=float("inf")),))
    assert json.loads(sample_row(lost)) == [0, None, None, None, None, None, None]


def test_many_stations_share_the_rows_that_are_kept(view) -> None:
    for number in range(ROWS[0][0] + 1):
        view.handle_sample(sample(1, f"station-{number}").encode())
    assert {station.kept_rows for station in view.stations.values()} == {ROWS[1][1]}
