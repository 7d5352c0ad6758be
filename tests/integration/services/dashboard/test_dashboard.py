"""The web application over a bus, by an HTTP client: files, states, questions to others, and who is refused."""

import asyncio
import contextlib
import json
import socket

import httpx
import pytest
from memory_bus import MemoryBus
from starlette.types import Message

from wetwell.protocols.bus.keys import (
    alarm_act_key,
    history_key,
    maintenance_act_key,
    maintenance_key,
    sample_block_key,
    sample_key,
)
from wetwell.protocols.errors import ConfigError
from wetwell.protocols.messages.alarm import Alarm, AlarmAct, AlarmAnswer
from wetwell.protocols.messages.history import History, HistoryQuery
from wetwell.protocols.messages.maintenance import MaintenanceAct, MaintenanceRecord
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.recordings.recording import read_recording
from wetwell.protocols.timestamps import MAX_STAMP_NS, NS_PER_S
from wetwell.services.dashboard import login
from wetwell.services.dashboard.app import AppState, dashboard_app
from wetwell.services.dashboard.daemon import serve_dashboard
from wetwell.services.dashboard.event_streams import EventStreams
from wetwell.services.dashboard.feed import Feed
from wetwell.services.dashboard.view.site_view import ROWS, SiteView
from wetwell.services.dashboard.web import open_socket, web_server
from wetwell.services.runtime.settings import DashboardSettings, Settings
from wetwell.services.security.tokens import new_token, revoke_token

PAGE = "http://127.0.0.1:8080"


def client_of(app_state):
    return httpx.AsyncClient(transport=httpx.ASGITransport(dashboard_app(app_state)), base_url=PAGE)


def app_state_with(bus=None, reports=None):
    return AppState(SiteView(10.0), EventStreams(), reports, bus)


def get(path, app_state=None, **headers):
    async def run():
        async with client_of(app_state or app_state_with()) as client:
            return await client.get(path, headers=headers)

    return asyncio.run(run())


def a_sample(second, station="alpha"):
    pump = PumpReading(frequency_hz=50.0, flow_m3h=200.5, head_m=26.0, power_kw=None, running=True)
    return Sample(station=station, seq=second, time=second * NS_PER_S, level_m=1.25, pumps=(pump,))


@pytest.mark.parametrize("path", ["/", "/station/alpha", "/alarms", "/reports", "/health"])
def test_every_page_is_the_shell_without_inline_script_and_under_a_strict_policy(path) -> None:
    answer = get(path)
    assert answer.status_code == 200
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "script-src 'self'" in policy
    assert "unsafe" not in policy
    assert "<script>" not in answer.text
    assert "style=" not in answer.text
    assert answer.headers["x-content-type-options"] == "nosniff"


def test_all_files_that_the_shell_names_are_there_and_kept_for_ever() -> None:
    async def run():
        async with client_of(app_state_with()) as client:
            shell = (await client.get("/")).text
            names = {part.split('"')[0] for part in shell.split('="') if part.startswith("/static/")}
            assert len(names) > 20
            for name in names:
                answer = await client.get(name)
                assert answer.status_code == 200, name
                assert "immutable" in answer.headers["cache-control"]
                assert answer.headers["content-encoding"] == "gzip"
                again = await client.get(name, headers={"if-none-match": answer.headers["etag"]})
                assert (again.status_code, again.content) == (304, b"")
            plain = await client.get(name, headers={"accept-encoding": "identity"})
            assert "content-encoding" not in plain.headers
            old = await client.get("/static/0123456789ab/theme.js")
            assert old.status_code == 404

    asyncio.run(run())


def test_the_favicon_is_served() -> None:
    assert get("/favicon.ico").headers["content-type"] == "image/svg+xml"


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8080", "127.0.0.1.evil.example", ""])
def test_a_name_that_was_made_to_point_here_is_refused(host) -> None:
    answer = get("/api/stations", host=host)
    assert answer.status_code == 421
    assert "content-security-policy" in answer.headers


@pytest.mark.parametrize("host", ["127.0.0.1:8080", "localhost:8080", "[::1]:8080", "localhost"])
def test_names_of_this_machine_are_heard(host) -> None:
    assert get("/api/stations", host=host).status_code == 200


def acting(app_state, body, **headers):
    async def run():
        async with client_of(app_state) as client:
            kind = {"content-type": "application/json"}
            return await client.post("/api/stations/alpha/alarm-act", content=body, headers=kind | headers)

    return asyncio.run(run())


ACT = AlarmAct(id="1", station="alpha", alarm="pump1.pump_fault", act="acknowledge", by="Ada")


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"content-type": "text/plain"}, 415),
        ({"content-type": "application/x-www-form-urlencoded"}, 415),
        ({"origin": "http://evil.example"}, 403),
        ({"origin": "http://127.0.0.1:9999"}, 403),
        ({"origin": "null"}, 403),
    ],
)
def test_an_act_that_a_foreign_page_sends_is_refused(headers, status) -> None:
    assert acting(app_state_with(MemoryBus()), ACT.encode(), **headers).status_code == status


@pytest.mark.parametrize(
    ("body", "rule"),
    [
        (b"", "json"),
        (b"{}", "id"),
        (ACT.model_copy(update={"by": ""}).encode(), "by"),
        (ACT.model_copy(update={"station": "beta"}).encode(), "station: got 'beta'"),
        (ACT.model_copy(update={"act": "shelve"}).encode(), "minutes"),
    ],
)
def test_what_is_no_act_is_told(body, rule) -> None:
    answer = acting(app_state_with(MemoryBus()), body)
    assert answer.status_code == 400
    assert rule.lower() in answer.json()["error"].lower()


def test_without_a_bus_or_an_answer_that_is_told(monkeypatch) -> None:
    assert acting(app_state_with(), ACT.encode()).status_code == 503
    monkeypatch.setattr("wetwell.services.dashboard.past.client.ANSWER_S", 0.01)
    silent = acting(app_state_with(MemoryBus()), ACT.encode())
    assert (silent.status_code, silent.json()["error"]) == (504, "the alarm service does not answer")
    span = "kind=samples&start=2025-01-01&end=2025-01-02"
    past = get(f"/api/stations/alpha/history?{span}", app_state_with(MemoryBus()))
    assert past.json()["error"] == "the historian does not answer"


@contextlib.asynccontextmanager
async def answering(bus, key, answer):
    """A service that answers each question with `answer(payload)`."""
    questions = bus.answer(key)

    async def run():
        while True:
            for request in await questions.receive():
                request.reply(answer(request.payload))

    task = asyncio.create_task(run())
    try:
        yield
    finally:
        task.cancel()


def test_an_act_goes_to_the_alarm_service_and_its_answer_comes_back() -> None:
    alarm = Alarm(
        id=ACT.alarm,
        time=0,
        station="alpha",
        priority="high",
        state="acknowledged",
        is_active=True,
        text="x",
        by="Ada",
    )

    def answer(payload):
        act = AlarmAct.decode(payload)
        assert act == ACT
        return AlarmAnswer(id=act.id, is_done=True, alarm=alarm).encode()

    async def run():
        bus = MemoryBus()
        async with answering(bus, alarm_act_key("alpha"), answer), client_of(app_state_with(bus)) as client:
            kind = {"content-type": "application/json", "origin": PAGE}
            return await client.post("/api/stations/alpha/alarm-act", content=ACT.encode(), headers=kind)

    told = asyncio.run(run()).json()
    assert told["is_done"]
    assert told["alarm"]["by"] == "Ada"


@pytest.mark.parametrize(
    "query", ["", "kind=nothing&start=2025-01-01&end=2025-01-02", "kind=kpi&start=2025-01-02&end=x"]
)
def test_what_is_no_question_to_the_historian_is_told(query) -> None:
    answer = get(f"/api/stations/alpha/history?{query}", app_state_with(MemoryBus()))
    assert answer.status_code == 400
    assert answer.json()["error"]


@pytest.mark.parametrize("path", ["/events", "/api/stations/alpha/history", "/api/stations/alpha/history/"])
def test_a_query_that_is_not_encoded_is_refused(path) -> None:
    """Browsers encode what they ask; the framework raises where somebody else does not."""
    told = []

    async def send(message: Message) -> None:
        told.append(message)

    async def receive() -> Message:
        return {"type": "http.request", "body": b"", "more_body": False}

    head = {"type": "http", "http_version": "1.1", "method": "GET", "scheme": "http", "root_path": ""}
    scope = head | {"path": path, "raw_path": path.encode(), "query_string": b"station=\xa7"}
    scope |= {"headers": [(b"host", b"127.0.0.1")], "client": ("127.0.0.1", 1), "server": ("127.0.0.1", 80)}
    asyncio.run(dashboard_app(app_state_with(MemoryBus()))(scope, receive, send))
    assert told[0]["status"] == 400
    assert b"percent-encoded" in told[1]["body"]


@pytest.mark.parametrize("form", ["messages", "columns"])
def test_a_recording_is_put_together_from_pages_and_can_be_read(tmp_path, monkeypatch, form) -> None:
    monkeypatch.setattr("wetwell.services.dashboard.past.client.ROWS_A_QUESTION", 100)
    rows = 250
    every = [json.loads(a_sample(second).encode()) for second in range(rows)]

    def answer(payload):
        query = HistoryQuery.decode(payload)
        assert query.raw
        found = every[-(-query.start // NS_PER_S) : query.end // NS_PER_S]
        page, more = found[: query.points], len(found) > query.points
        if form == "messages":
            return History(station="alpha", kind="samples", messages=tuple(page), more=more).encode()
        pumps = [message["pumps"][0] for message in page]
        columns = {"seq": [message["seq"] for message in page], "level_m": [message["level_m"] for message in page]}
        columns |= {
            f"pump1_{name}": [pump[name] for pump in pumps] for name in ("flow_m3h", "frequency_hz", "running")
        }
        times = tuple(message["time"] for message in page)
        return History(station="alpha", kind="samples", time=times, columns=columns, more=more).encode()

    async def run():
        bus = MemoryBus()
        async with answering(bus, history_key("*"), answer), client_of(app_state_with(bus)) as client:
            span = {"start": "1970-01-01T00:00:00Z", "end": "1970-01-02T00:00:00Z"}
            whole = await client.get("/api/stations/alpha/recording.csv", params=span)
            late = {"start": "1980-01-01T00:00:00Z", "end": "1980-01-02T00:00:00Z"}
            return whole, await client.get("/api/stations/alpha/recording.csv", params=late)

    whole, nothing = asyncio.run(run())
    assert nothing.status_code == 404
    assert 'filename="alpha.csv"' in whole.headers["content-disposition"]
    path = tmp_path / "alpha.csv"
    path.write_bytes(whole.content)
    recording = read_recording(path)
    assert len(recording.time_ns) == rows
    assert recording.time_ns.tolist() == [second * NS_PER_S for second in range(rows)]
    assert recording.column("pump1_flow_m3h")[-1] == 200.5
    assert recording.column("pump1_running")[-1] == 1.0
    assert recording.column("level_m").tolist() == [1.25] * rows
    assert not recording.ignored
    assert recording.station == "alpha"


def test_reports_are_listed_and_nothing_outside_of_their_folder_is_served(tmp_path) -> None:
    folder = tmp_path / "reports"
    (folder / "gap").mkdir(parents=True)
    (folder / "gap" / "report.html").write_text("<p>gap</p>")
    (tmp_path / "secret.html").write_text("secret")
    (folder / "link.html").symlink_to(tmp_path / "secret.html")
    app_state = app_state_with(reports=folder)
    assert [report["name"] for report in get("/api/reports", app_state).json()["reports"]] == ["gap/report.html"]
    page = get("/reports/gap/report.html", app_state)
    assert page.text == "<p>gap</p>"
    assert "script-src" not in page.headers["content-security-policy"]
    assert "sandbox" in page.headers["content-security-policy"]
    outside = ("../secret.html", "%2e%2e/secret.html", "link.html")
    for name in (*outside, "gap", "none.html", "a%00.html", f"{'a' * 300}.html"):
        assert get(f"/reports/{name}", app_state).status_code == 404, name
    assert get("/api/reports").json()["reason"] == "the setting dashboard.reports names no folder of HTML reports"


def test_samples_come_from_the_bus_to_the_browser_and_all_streams_end_with_the_server() -> None:
    async def run():
        bus = MemoryBus()
        app_state = app_state_with(bus)
        listener = open_socket("127.0.0.1", 0)
        address = f"http://127.0.0.1:{listener.getsockname()[1]}"
        events = []
        async with (
            httpx.AsyncClient(base_url=address, timeout=10) as client,
            web_server(dashboard_app(app_state), listener, app_state.streams),
        ):
            feeding = asyncio.create_task(Feed(bus, app_state.view, app_state.streams).run())
            publisher = bus.publisher(sample_key("alpha"))
            async with client.stream("GET", "/events", params={"station": "alpha"}) as stream:
                assert stream.headers["content-type"].startswith("text/event-stream")
                lines = stream.aiter_lines()
                assert [await anext(lines) for _ in range(2)] == ["retry: 1000", "event: resync"]
                publisher.put(a_sample(1).encode())
                async for line in lines:
                    if line.startswith('data: {"id"'):
                        events.append(json.loads(line.removeprefix("data: ")))
                        app_state.streams.close()
            state = (await client.get("/api/stations/alpha")).json()
            feeding.cancel()
        return events, state

    events, state = asyncio.run(run())
    assert [row[0] for event in events for row in event["rows"]] == [1000]
    assert state["rows"] == events[0]["rows"]


class SlowBus(MemoryBus):
    """Answers only when two questions are on the way."""

    def __init__(self) -> None:
        super().__init__()
        self.both = asyncio.Barrier(2)

    async def ask(self, key, payload=b"", *, timeout_s=5.0):
        await self.both.wait()
        return await super().ask(key, payload, timeout_s=timeout_s)


def test_stations_that_have_spoken_before_are_there_at_once_single_and_gathered() -> None:
    async def run():
        bus = SlowBus()
        bus.publisher(sample_key("alpha")).put(a_sample(7).encode())
        gathered = SampleBlock.of([a_sample(second, "beta") for second in range(200)]).encode()
        beta = bus.publisher(sample_block_key("beta"))
        beta.put(gathered)
        app_state = app_state_with(bus)
        feed = Feed(bus, app_state.view, app_state.streams)
        beta.put(gathered)  # while the feed begins: it comes as an answer, too
        feeding = asyncio.create_task(feed.run())
        async with asyncio.timeout(5.0):
            while app_state.view.frame_id < 2:  # noqa: ASYNC110 - nothing else tells it
                await asyncio.sleep(0.01)
        feeding.cancel()
        return {name: [row[0] for row in rows_of(app_state, name)] for name in ("alpha", "beta")}

    assert asyncio.run(run()) == {"alpha": [7000], "beta": [1000 * second for second in range(200)]}


def past_of(payload):
    """A historian that has kept a sample each second since 1970."""
    query = HistoryQuery.decode(payload)
    seconds = range(max(0, -(-query.start // NS_PER_S)), -(-query.end // NS_PER_S))
    assert query.kind == "samples"
    assert len(seconds) <= query.points
    columns = {"level_m": (2.5,) * len(seconds), "pump1_frequency_hz": (50.0,) * len(seconds)}
    times = tuple(second * NS_PER_S for second in seconds)
    return History(station="alpha", kind="samples", time=times, columns=columns).encode()


@contextlib.asynccontextmanager
async def looked_at(bus, monkeypatch):
    """The state of an app that hears station alpha since second 2000 and beta, with a page that is open on alpha."""
    monkeypatch.setattr("wetwell.services.dashboard.past.backfill.SETTLED_S", 0.0)
    app_state = app_state_with(bus)
    publishers = {name: bus.publisher(sample_key(name)) for name in ("alpha", "beta")}
    events = app_state.streams.listen("alpha")
    feeding = asyncio.create_task(Feed(bus, app_state.view, app_state.streams).run())
    assert b"resync" in await anext(events)
    for name, publisher in publishers.items():
        publisher.put(a_sample(2000, name).encode())
    try:
        yield app_state, publishers["alpha"], events
    finally:
        feeding.cancel()


def rows_of(app_state, station="alpha"):
    text = app_state.view.station_state(station)
    return [] if text is None else json.loads(text)["rows"]


def test_charts_of_a_station_that_is_looked_at_begin_with_what_the_historian_has(monkeypatch) -> None:
    async def run():
        bus = MemoryBus()
        questions = []

        def answer(payload):
            questions.append(payload)
            return past_of(payload)

        async with (
            answering(bus, history_key("*"), answer),
            looked_at(bus, monkeypatch) as (app_state, alpha, events),
        ):
            async for event in events:
                if b"resync" in event:  # open pages are told to ask for the whole state
                    break
            alpha.put(a_sample(2001).encode())
            await until(lambda: rows_of(app_state)[-1][0] == 2_001_000)
            return rows_of(app_state), rows_of(app_state, "beta"), questions

    rows, unseen, questions = asyncio.run(run())
    assert len(rows) == ROWS[0][1]
    assert [row[0] for row in rows] == [second * 1000 for second in range(2002 - len(rows), 2002)]
    assert rows[-3][:4] == [1_999_000, 2.5, None, 50]
    assert len(unseen) == 1, "nobody looks at beta"
    assert len(questions) == 1


@pytest.mark.parametrize(
    "answer", [None, b"{}", History(station="alpha", kind="samples", error="disk full").encode()]
)
def test_charts_begin_with_what_comes_where_no_historian_tells_more_and_ask_again(monkeypatch, answer) -> None:
    monkeypatch.setattr("wetwell.services.dashboard.past.backfill.AGAIN_S", 0.3)

    async def run():
        bus = MemoryBus()
        asked = []

        def refuse(payload):
            asked.append(payload)
            return answer

        async with contextlib.AsyncExitStack() as stack:
            if answer is not None:
                await stack.enter_async_context(answering(bus, history_key("*"), refuse))
            app_state, alpha, _ = await stack.enter_async_context(looked_at(bus, monkeypatch))
            await until(lambda: len(rows_of(app_state)) == 1 and (answer is None or asked))
            alpha.put(a_sample(2001).encode())
            await until(lambda: len(rows_of(app_state)) == 2)
            async with answering(bus, history_key("*"), past_of) if answer is None else contextlib.nullcontext():
                await until(lambda: len(asked) == 2 or len(rows_of(app_state)) > 2)
            return rows_of(app_state)

    rows = asyncio.run(run())
    assert len(rows) == (ROWS[0][1] if answer is None else 2)


def test_a_station_in_a_time_that_nobody_keeps_harms_nothing(monkeypatch) -> None:
    async def run():
        bus = MemoryBus()
        async with looked_at(bus, monkeypatch) as (app_state, alpha, _):
            early = a_sample(0, "gamma").model_copy(update={"time": -MAX_STAMP_NS})
            bus.publisher(sample_key("gamma")).put(early.encode())
            gamma = app_state.streams.listen("gamma")
            await anext(gamma)
            assert b'"rows"' in await anext(gamma)
            alpha.put(a_sample(2001).encode())
            await until(lambda: len(rows_of(app_state)) == 2)  # the feed goes on
            return rows_of(app_state, "gamma")

    assert len(asyncio.run(run())) == 1


async def until(is_so):
    """Wait for what the server does in this very loop."""
    async with asyncio.timeout(30):
        while not is_so():  # noqa: ASYNC110 - it is the server's doing, not a wait for time
            await asyncio.sleep(0)


def test_200_open_pages_all_get_each_frame() -> None:
    pages, frames = 200, 4

    async def look(client, got):
        async with client.stream("GET", "/events", params={"station": "alpha"}) as stream:
            async for line in stream.aiter_lines():
                if line.startswith('data: {"id"'):
                    got.append(json.loads(line.removeprefix("data: "))["id"])
                    if len(got) == frames:
                        return

    async def run():
        app_state = app_state_with(MemoryBus())
        listener = open_socket("127.0.0.1", 0)
        address = f"http://127.0.0.1:{listener.getsockname()[1]}"
        got = [[] for _ in range(pages)]
        limits = httpx.Limits(max_connections=None)
        loop = asyncio.get_running_loop()
        async with (
            httpx.AsyncClient(base_url=address, timeout=30, limits=limits) as client,
            web_server(dashboard_app(app_state), listener, app_state.streams),
            asyncio.TaskGroup() as group,
        ):
            for numbers in got:
                group.create_task(look(client, numbers))
            await until(lambda: app_state.streams.clients == pages)
            for number in range(1, frames + 1):
                app_state.view.handle_sample(a_sample(number).encode())
                app_state.streams.send("alpha", app_state.view.advance(loop.time())["alpha"])
        return got

    assert asyncio.run(run()) == [[1, 2, 3, 4]] * pages


@pytest.fixture(scope="module")
def tokens(tmp_path_factory):
    """File of tokens, and the tokens of an operator and a viewer."""
    file = tmp_path_factory.mktemp("tokens") / "tokens.toml"
    return file, new_token(file, "ada", "operator"), new_token(file, "eve", "viewer")


@contextlib.asynccontextmanager
async def guarded(file, bus=None):
    app = dashboard_app(app_state_with(bus), file, is_local=False)
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="https://site.example") as client:
        yield client


def test_with_tokens_data_needs_one_and_the_shell_does_not(tokens) -> None:
    file, _, viewer = tokens

    async def run():
        async with guarded(file) as client:
            for path in ("/", "/favicon.ico", "/api/who"):
                assert (await client.get(path)).status_code == 200, path
        for path in ("/api/stations", "/api/stations/a", "/api/alarms", "/api/health", "/events", "/reports/x.html"):
            async with guarded(file) as client:  # each counts wrong tokens anew
                for headers in ({}, {"authorization": "Bearer wrong"}, {"cookie": "wetwell_token=wrong"}):
                    assert (await client.get(path, headers=headers)).status_code == 401, path
        async with guarded(file) as client:
            bearer = {"authorization": f"Bearer {viewer}"}
            assert (await client.get("/api/stations", headers=bearer)).status_code == 200

    asyncio.run(run())


def test_a_login_sets_a_cookie_that_scripts_and_other_sites_do_not_get(tokens) -> None:
    file, operator, _ = tokens

    async def run():
        async with guarded(file) as client:
            assert (await client.get("/api/who")).json() == {"asks": True, "name": None, "role": None}
            wrong = await client.post("/api/login", json={"token": "wrong"})
            assert wrong.json()["name"] is None
            assert (await client.post("/api/login", json={})).status_code == 400
            right = await client.post("/api/login", json={"token": operator})
            assert right.json() == {"asks": True, "name": "ada", "role": "operator"}
            cookie = right.headers["set-cookie"].lower()
            for word in ("httponly", "samesite=strict", "secure", "path=/"):
                assert word in cookie
            assert (await client.get("/api/stations")).status_code == 200  # the client keeps the cookie

    asyncio.run(run())


def test_a_request_that_is_too_long_or_nested_too_deeply_is_refused_before_any_token(tokens) -> None:
    file, *_ = tokens

    async def run():
        async def endless():
            while True:
                yield b" " * 4096

        headers = {"content-type": "application/json"}
        async with guarded(file) as client:
            long = await client.post("/api/login", content=endless(), headers=headers)
            assert (long.status_code, long.json()) == (413, {"error": "body: must be no more than 65536 bytes"})
            deep = await client.post("/api/login", content=b"[" * 3000, headers=headers)
            assert (deep.status_code, deep.json()) == (400, {"error": "token: must be given"})

    asyncio.run(run())


def test_of_an_address_with_many_wrong_tokens_only_a_right_one_is_heard(tokens) -> None:
    file, operator, _ = tokens

    async def run():
        async with guarded(file) as client:
            told = [await client.get("/api/stations", headers={"authorization": f"Bearer {n}"}) for n in range(12)]
            assert [each.status_code for each in told] == [401] * 10 + [429] * 2
            assert "too many wrong tokens from 127.0.0.1: wait" in told[-1].json()["error"]
            entry = await client.post("/api/login", json={"token": "wrong"})
            assert entry.status_code == 429
            who = await client.get("/api/who", headers={"authorization": "Bearer wrong"})
            assert who.status_code == 429
            assert (await client.get("/api/stations")).status_code == 401  # no token, no attempt
            assert (await client.post("/api/login", json={"token": operator})).json()["name"] == "ada"

    asyncio.run(run())


def test_a_stream_ends_with_the_token_that_opened_it(tmp_path, monkeypatch) -> None:
    file = tmp_path / "tokens.toml"
    token = new_token(file, "ada", "viewer")
    monkeypatch.setattr(login, "CHECK_S", 0.0)
    app_state = app_state_with(None)

    async def run() -> list[bytes]:
        app = dashboard_app(app_state, file, is_local=False)
        sent = asyncio.Queue()
        scope = {
            "type": "http",
            "asgi": {"version": "3.0", "spec_version": "2.4"},
            "method": "GET",
            "path": "/events",
            "query_string": b"station=alpha",
            "headers": [(b"authorization", f"Bearer {token}".encode())],
            "client": ("192.0.2.7", 1),
        }
        asked = asyncio.create_task(app(scope, asyncio.Queue().get, sent.put))
        got = [await sent.get() for _ in range(2)]
        app_state.streams.send("alpha", "1")
        got.append(await sent.get())
        revoke_token(file, "ada")
        app_state.streams.send("alpha", "2")
        await asked
        return [message.get("body", b"") for message in [*got, await sent.get()]]

    assert asyncio.run(run())[2:] == [b"data: 1\n\n", b""]


def test_only_operators_act_and_always_in_their_own_name(tokens) -> None:
    file, operator, viewer = tokens
    acts = []

    def answer(payload):
        acts.append(AlarmAct.decode(payload))
        return AlarmAnswer(id=acts[-1].id, is_done=True).encode()

    async def run():
        bus = MemoryBus()
        statuses = []
        async with answering(bus, alarm_act_key("alpha"), answer), guarded(file, bus) as client:
            for token in ("", viewer, operator):
                headers = {"content-type": "application/json", "authorization": f"Bearer {token}"}
                told = await client.post("/api/stations/alpha/alarm-act", content=ACT.encode(), headers=headers)
                statuses.append(told.status_code)
        return statuses

    assert asyncio.run(run()) == [401, 403, 200]
    assert [act.by for act in acts] == ["ada"]


def test_a_file_of_tokens_that_cannot_be_read_lets_nobody_in(tokens, tmp_path) -> None:
    _, operator, _ = tokens
    broken = tmp_path / "tokens.toml"
    broken.write_text("token = 1")

    async def run():
        async with guarded(broken) as client:
            return await client.get("/api/stations", headers={"authorization": f"Bearer {operator}"})

    assert asyncio.run(run()).status_code == 503


def test_a_page_for_others_is_refused_without_tokens() -> None:
    settings = Settings(dashboard=DashboardSettings(host="0.0.0.0", port=0))
    with pytest.raises(ConfigError, match="refuses to listen"):
        asyncio.run(serve_dashboard(settings))


def maintained(app_state, body, **headers):
    async def run():
        async with client_of(app_state) as client:
            kind = {"content-type": "application/json"}
            return await client.post("/api/stations/alpha/maintenance", content=body, headers=kind | headers)

    return asyncio.run(run())


@pytest.mark.parametrize(
    ("body", "rule"),
    [
        (b"", "json"),
        (b"[]", "object"),
        (b'{"act": "pulled", "found": "rags", "by": "Ada"}', "asset"),
        (b'{"asset": "engine", "act": "pulled", "by": "Ada"}', "asset"),
        (b'{"asset": "pump:1", "act": "pulled", "by": ""}', "by"),
        (b'{"asset": "pump:1", "act": "pulled", "by": "Ada", "at": "soon"}', "time"),
    ],
)
def test_what_is_no_act_of_maintenance_is_told(body, rule) -> None:
    answer = maintained(app_state_with(MemoryBus()), body)
    assert answer.status_code == 400
    assert rule in answer.json()["error"].lower()


def test_an_act_of_maintenance_goes_to_the_detector_and_its_record_comes_back(monkeypatch) -> None:
    bus = MemoryBus()
    records = bus.publisher(maintenance_key("alpha"))

    async def run(asset):
        acts = bus.subscribe(maintenance_act_key("alpha"))

        async def enter():
            for payload in await acts.receive():
                act = MaintenanceAct.decode(payload)
                fields = act.model_dump(exclude={"schema_name"}) | {"time": act.time or 7}
                refused = "" if act.asset == "pump:1" else "asset: got 'pump:9'"
                records.put(MaintenanceRecord(**fields, refused=refused).encode())

        entering = asyncio.create_task(enter())
        body = {"asset": asset, "act": "pulled", "found": "rags", "by": "Ada", "at": "2026-01-02T03:04:05Z"}
        async with client_of(app_state_with(bus)) as client:
            answer = await client.post("/api/stations/alpha/maintenance", json=body)
        await entering
        return answer

    told = asyncio.run(run("pump:1"))
    assert told.status_code == 200
    expected = {"asset": "pump:1", "found": "rags", "time": "2026-01-02T03:04:05Z", "result": "pending"}
    assert expected.items() <= told.json().items()
    refused = asyncio.run(run("pump:9"))
    assert (refused.status_code, refused.json()["error"]) == (400, "asset: got 'pump:9'")
    monkeypatch.setattr("wetwell.services.dashboard.past.client.ANSWER_S", 0.01)
    silent = maintained(app_state_with(MemoryBus()), b'{"asset": "main", "act": "flushed", "by": "Ada"}')
    assert (silent.status_code, silent.json()["error"]) == (504, "the detector does not answer")


@pytest.mark.parametrize("kind", ["episodes", "maintenance"])
def test_episodes_and_the_log_of_maintenance_come_from_the_historian(kind) -> None:
    asked = []

    def answer(payload):
        asked.append(HistoryQuery.decode(payload))
        return History(station="alpha", kind=kind, messages=({"asset": "main"},)).encode()

    async def run():
        bus = MemoryBus()
        async with answering(bus, history_key("alpha"), answer), client_of(app_state_with(bus)) as client:
            return await client.get(f"/api/stations/alpha/{kind}?from=2026-01-01T00:00:00Z&to=2026-01-02T00:00:00Z")

    told = asyncio.run(run())
    assert told.json() == {"station": "alpha", kind: [{"asset": "main"}]}
    assert (asked[0].kind, asked[0].end - asked[0].start) == (kind, 86_400 * 10**9)


def test_what_is_sent_does_not_wait_for_the_receipt_of_what_went_before():
    """Else each file takes 40 ms: its head and its body are two packets."""
    with open_socket("127.0.0.1", 0) as listener, socket.create_connection(listener.getsockname()):
        accepted, _ = listener.accept()
        with accepted:
            assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
