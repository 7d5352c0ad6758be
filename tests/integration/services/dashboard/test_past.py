"""What the page asks of the historian: trends, bands, the journal, and whether a station is there at all."""

import asyncio
import contextlib
import json

import httpx
import pytest
from memory_bus import MemoryBus

from wetwell.protocols.bus.keys import SITE, history_key
from wetwell.protocols.messages.alarm import Alarm
from wetwell.protocols.messages.history import History, HistoryQuery
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import NS_PER_S, from_iso
from wetwell.services.dashboard.app import AppState, dashboard_app
from wetwell.services.dashboard.event_streams import EventStreams
from wetwell.services.dashboard.view.site_view import SiteView
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore

PAGE = "http://127.0.0.1:8080"
DAY = "2025-01-01T00:00:00Z"
START_NS = from_iso(DAY)


def at(second):
    return START_NS + second * NS_PER_S


def sample(second):
    pump = PumpReading(frequency_hz=50.0, flow_m3h=200.123456, head_m=26.0, power_kw=18.0, running=True)
    return Sample(station="alpha", seq=second, time=at(second), level_m=1.23456, pumps=(pump,))


def verdict(second, state, **fields):
    return Verdict(
        time=at(second), station="alpha", pump=1, state=state, probability={state: 1.0}, evidence={"long": "x" * 500},
        window=(at(0), at(second)), **fields,
    )  # fmt: skip


def alarm(second, state, *, is_active, station="alpha", **fields):
    return Alarm(
        id="level_high", time=at(second), station=station, priority="high", state=state, is_active=is_active,
        text="level high", raised=at(100), **fields,
    )  # fmt: skip


@pytest.fixture
def historian(tmp_path):
    """A real historian with ten minutes of a station: it learns, is normal, is at fault; its level was high once."""
    with contextlib.closing(FolderStore(tmp_path)) as store:
        keeper = Historian(store)
        for second in range(600):
            keeper.handle("samples", sample(second).encode())
        for second in range(0, 600, 10):
            state = "learning" if second < 200 else "normal" if second < 400 else "pump_fault"
            keeper.handle("verdicts", verdict(second, state).encode())
        keeper.handle("verdicts", verdict(599, "pump_fault", asset="pump:1", stage="act").encode())
        keeper.handle("alarms", alarm(100, "unacknowledged", is_active=True).encode())
        keeper.handle("alarms", alarm(300, "returned", is_active=False, returned=at(300)).encode())
        keeper.handle("alarms", alarm(50, "unacknowledged", is_active=True, station=SITE).encode())
        keeper.commit(at(600))
        yield keeper


def asked(historian, *paths):
    """Answers of the page to some requests, over a bus on which the historian answers."""

    async def run():
        bus = MemoryBus()
        questions = bus.answer(history_key("*"))

        async def reply():
            while True:
                for request in await questions.receive():
                    request.reply(historian.answer(request.key.split("/")[1], request.payload))

        answering = asyncio.create_task(reply())
        app_state = AppState(SiteView(10.0), EventStreams(), None, bus)
        transport = httpx.ASGITransport(dashboard_app(app_state))
        try:
            async with httpx.AsyncClient(transport=transport, base_url=PAGE) as client:
                return [await client.get(path) for path in paths]
        finally:
            answering.cancel()

    return asyncio.run(run())


def test_trends_are_short_and_in_ms(historian) -> None:
    (answer,) = asked(historian, f"/api/stations/alpha/trends?start={DAY}&end=2025-01-01T00:00:03Z&points=700")
    told = answer.json()
    assert told["time"] == [at(second) // 1_000_000 for second in range(3)]
    assert told["columns"]["pump1_flow_m3h"] == [200.1] * 3
    assert told["columns"]["level_m"] == [1.235] * 3


def test_changes_are_what_says_something_new_with_what_stood_at_the_beginning(historian) -> None:
    query = HistoryQuery(kind="changes", start=at(300), end=at(600))
    history = History.decode(historian.answer("alpha", query.encode()))
    told = [(message["time"], message["state"], message["stage"]) for message in history.messages]
    assert told == [
        ("2025-01-01T00:03:20Z", "normal", None),
        ("2025-01-01T00:06:40Z", "pump_fault", None),
        ("2025-01-01T00:09:59Z", "pump_fault", "act"),
    ]
    assert len(history.encode()) < 1000


def test_bands_of_a_span_tell_what_stood_in_it(historian) -> None:
    span = "start=2025-01-01T00:05:30Z&end=2025-01-01T00:10:00Z"
    (answer,) = asked(historian, f"/api/stations/alpha/bands?{span}")
    told = answer.json()
    assert not told["error"]
    assert [(band["state"], band["from"], band["to"]) for band in told["verdicts"]][:2] == [
        ("normal", "2025-01-01T00:03:20Z", "2025-01-01T00:06:40Z"),
        ("pump_fault", "2025-01-01T00:06:40Z", "2025-01-01T00:09:59Z"),
    ]
    assert told["alarms"] == []
    (answer,) = asked(historian, f"/api/stations/alpha/bands?start={DAY}&end=2025-01-01T00:02:30Z")
    (band,) = answer.json()["alarms"]
    assert (band["from"], band["to"]) == ("2025-01-01T00:01:40Z", "2025-01-01T00:05:00Z")


def test_the_journal_has_the_changes_newest_first(historian) -> None:
    one, wrong = asked(historian, "/api/alarms/journal?station=alpha", "/api/alarms/journal?start=never")
    assert [line["state"] for line in one.json()["lines"]] == ["returned", "unacknowledged"]
    assert wrong.status_code == 400
    (whole,) = asked(historian, "/api/alarms/journal")
    assert [line["station"] for line in whole.json()["lines"]] == [SITE]  # no other was heard of


def test_a_station_that_only_the_historian_knows_has_a_page_and_another_has_none(historian) -> None:
    known, state, unknown, nothing = asked(
        historian, "/station/alpha", "/api/stations/alpha", "/station/nowhere", "/api/stations/nowhere"
    )
    assert (known.status_code, state.status_code, unknown.status_code, nothing.status_code) == (200, 200, 404, 404)
    assert state.json()["quality"] is None
    assert unknown.text == known.text
    assert nothing.json() == {"error": "there is no station 'nowhere'"}


def test_without_a_historian_that_is_said_and_figures_are_told_all_the_same(monkeypatch) -> None:
    monkeypatch.setattr("wetwell.services.dashboard.past.client.ANSWER_S", 0.01)

    async def run():
        app_state = AppState(SiteView(10.0), EventStreams(), None, MemoryBus())
        app_state.view.handle_sample(sample(1).encode())
        app_state.view.advance(0.25)
        transport = httpx.ASGITransport(dashboard_app(app_state))
        async with httpx.AsyncClient(transport=transport, base_url=PAGE) as client:
            paths = ("trends?start=2025-01-01&end=2025-01-02", "bands?start=2025-01-01&end=2025-01-02")
            return [await client.get(f"/api/stations/alpha/{path}") for path in paths], await client.get("/metrics")

    (trends, bands), metrics = asyncio.run(run())
    assert (trends.status_code, trends.json()["error"]) == (502, "the historian does not answer")
    assert json.loads(bands.text)["error"] == "the historian does not answer"
    assert 'wetwell_pump_flow_m3h{pump="1",station="alpha"} 200.123456' in metrics.text
