"""Parsers that `fuzz.py` feeds, each with inputs as they should be.

A parser may refuse an input with an error of the project and must not raise anything else. The Modbus server must go
on, and the page must answer with a status below 500, or 503. What is kept with a checksum is also fed behind one that
fits, as somebody would write it who may write to the folder.
"""

import asyncio
import hashlib
import json
import runpy
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from wetwell.detector.detector import Detector
from wetwell.protocols.bus.publisher_cache import Page, PublisherCache, read_query, read_sequence_header
from wetwell.protocols.bus.roles import load_access
from wetwell.protocols.errors import WetwellError
from wetwell.protocols.messages.alarm import Alarm, AlarmAct
from wetwell.protocols.messages.gap_watch import GapWatch
from wetwell.protocols.messages.history import HistoryQuery
from wetwell.protocols.messages.maintenance import MaintenanceAct
from wetwell.protocols.messages.message import Message
from wetwell.protocols.messages.model import Model
from wetwell.protocols.messages.order import Order, Plan
from wetwell.protocols.messages.plant_clock import PlantClockOrder
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.messages.status import Status
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.modbus.client import HEAD_BYTES, Question, bytes_to_come, words_of
from wetwell.protocols.modbus.device_csv import read_map_csv
from wetwell.protocols.modbus.device_map import load_plcs
from wetwell.protocols.modbus.server import ModbusServer
from wetwell.protocols.recordings.importers.conversion import convert
from wetwell.protocols.recordings.importers.mapping import TagMapping, load_mapping
from wetwell.protocols.recordings.recording import read_recording, write_recording
from wetwell.services.alarms import state_file as alarm_state
from wetwell.services.dashboard.app import AppState, dashboard_app
from wetwell.services.dashboard.event_streams import EventStreams
from wetwell.services.dashboard.view.site_view import SiteView
from wetwell.services.detector.checkpoint import Checkpoint, Told
from wetwell.services.runtime.settings import load_settings
from wetwell.services.security.audit import LineAudit
from wetwell.services.security.audit_chain import broken_among
from wetwell.services.security.tokens import new_token, read_holders
from wetwell.services.stations import find_scenario, find_station
from wetwell.services.watch import state_file as watch_state
from wetwell.sim2real.watch.state import WatchState

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "services" / "schemas" / "examples"
STAMP = "2026-01-01T00:00:00Z"
DEEP = b"[" * 3000
"""JSON and TOML whose reader may run out of stack."""
RECORDING = b"time,level_m,pump1_flow_m3h\n2026-01-01T00:00:00Z,1.5,200\n2026-01-01T00:00:01Z,1.4,\n"
EXPORT = "Zeit;Füllstand;Durchfluss\n27.10.2024 02:50:00;120,5;40\n27.10.2024 02:00:00;122,4;\n"
EXPORT_MAPPING = TagMapping.model_validate(
    {
        "station": "north",
        "layout": "wide",
        "time_zone": "Europe/Berlin",
        "time_format": "%d.%m.%Y %H:%M:%S",
        "columns": {"time": "Zeit"},
        "signal": {
            "level_m": {"tag": "Füllstand", "unit": "cm"},
            "pump1_flow_m3h": {"tag": "Durchfluss", "unit": "l/s"},
        },
    }
)
PLC = b"""station = "harbour"\npumps = 1\nhost = "192.0.2.17"\nunit_id = 3
[signal]
level_m = { table = "input", address = 0, type = "uint16", unit = "%", scale = 0.01, span = [0.3, 5.3] }
pump1_running = { address = 110, type = "bit", bit = 3 }
"""
REQUEST = bytes.fromhex("000100000006010300000002")
WRITE = bytes.fromhex("00020000000b011000640002043f800000")
QUESTIONS = (
    Question(1, 1, "holding", 0, 2),
    Question(1, 1, "input", 0, 1),
    Question(1, 1, "coil", 0, 9),
    Question(1, 1, "discrete", 0, 1),
)
ANSWERED = {*range(200, 500), 503}

Feed = Callable[[bytes], object]


class Parser(NamedTuple):
    """How a parser is made ready, and inputs as they should be."""

    make: Callable[[], Feed]
    seeds: list[bytes]


def of_file(read: Callable[[Path], object], suffix: str) -> Callable[[], Feed]:
    """A reader of files."""

    def make() -> Feed:
        path = Path(tempfile.mkdtemp()) / f"input{suffix}"

        def feed(data: bytes) -> None:
            path.write_bytes(data)
            read(path)

        return feed

    return make


def of_state(read: Feed) -> Callable[[], Feed]:
    """A reader of states, whose callers take a `ValueError` for a refusal."""

    def feed(data: bytes) -> None:
        try:
            read(data)
        except ValueError as error:
            raise WetwellError(str(error)) from error

    return lambda: feed


def modbus() -> Feed:
    """The server: after each connection of garbage another one must get an answer."""
    loop = asyncio.new_event_loop()
    broken: list[str] = []
    loop.set_exception_handler(lambda _, context: broken.append(str(context)))
    server = ModbusServer(
        host="127.0.0.1", port=0, unit_id=1, word_order="ABCD", pumps=2, levels=2, on_write=lambda _: None
    )
    loop.run_until_complete(server.__aenter__())

    async def exchange(data: bytes) -> bytes:
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        writer.write(data)
        if data == REQUEST:
            answer = await asyncio.wait_for(reader.readexactly(9), 5.0)
        else:
            writer.write_eof()
            answer = await asyncio.wait_for(reader.read(), 5.0)
        writer.close()
        return answer

    def feed(data: bytes) -> None:
        loop.run_until_complete(exchange(data))
        answer = loop.run_until_complete(exchange(REQUEST))
        if broken or answer[:2] != REQUEST[:2]:
            raise RuntimeError(f"answer {answer.hex()}; {broken[:1]}")

    return feed


def modbus_answer(data: bytes) -> None:
    """What the gateway makes of a PLC's answer; the first byte says what it has asked."""
    question, frame = QUESTIONS[data[0] % len(QUESTIONS)] if data else QUESTIONS[0], data[1:]
    if len(frame) >= HEAD_BYTES:
        rest = bytes_to_come(question, frame[:HEAD_BYTES])
        words_of(question, frame[HEAD_BYTES : HEAD_BYTES + rest])


def cached_messages(data: bytes) -> None:
    """What comes with messages that are numbered and asked for again; the first byte is the length of the head."""
    end = 1 + (data[0] if data else 0)
    Page.decode(data[end:], data[1:end])
    read_sequence_header(data)
    read_query(data)


def http() -> Feed:
    """The page: the first line is method and address, then headers until an empty line, then the body."""
    app = dashboard_app(AppState(SiteView(10.0), EventStreams(), Path(tempfile.mkdtemp())))
    loop = asyncio.new_event_loop()

    async def status_of(data: bytes) -> int:
        head, _, body = data.partition(b"\n\n")
        first, *lines = head.split(b"\n")
        method, _, address = first.partition(b" ")
        path, _, query = address.partition(b"?")
        if path == b"/events":  # it answers for as long as somebody listens
            return 200
        sent: list[Any] = []

        async def receive() -> dict[str, Any]:
            return {"type": "http.request", "body": body, "more_body": False}

        async def send(message: Any) -> None:
            sent.append(message)

        headers = [
            (name.strip().lower(), value.strip()) for name, _, value in (line.partition(b":") for line in lines)
        ]
        scope = {
            "type": "http",
            "asgi": {"version": "3.0", "spec_version": "2.4"},
            "http_version": "1.1",
            "scheme": "http",
            "method": method.decode("latin-1"),
            "path": path.decode("utf-8", "replace"),
            "raw_path": path,
            "query_string": query,
            "headers": [(b"host", b"localhost"), *headers],
            "client": ("127.0.0.1", 1),
            "server": ("127.0.0.1", 8080),
        }
        await app(scope, receive, send)
        return int(sent[0]["status"])

    def feed(data: bytes) -> None:
        status = loop.run_until_complete(status_of(data))
        if status not in ANSWERED:
            raise RuntimeError(f"status {status}")

    return feed


class Kept:
    """A place that always holds the same bytes."""

    def __init__(self, data: bytes = b"") -> None:
        self.data = data

    def read(self) -> bytes:
        """What is there."""
        return self.data

    def write(self, data: bytes) -> None:
        """Put something else there."""
        self.data = data

    def put_aside(self) -> str:
        """Where it is then; it stays."""
        return "nowhere"


def checkpoint(data: bytes) -> None:
    """What the detector does with its file at its start."""
    Checkpoint(Kept(data)).restore(Detector.of(find_station("alpha")))


def sealed_snapshot(data: bytes) -> None:
    """A snapshot behind a header that fits."""
    detector = Detector.of(find_station("alpha"))
    header = json.loads(detector.snapshot().partition(b"\n")[0]) | {"sha256": hashlib.sha256(data).hexdigest()}
    if data == data.rstrip(b"\n"):
        detector.restore(json.dumps(header).encode() + b"\n" + data)


def sealed(data: bytes) -> bytes:
    """A state with its checksum in the last line."""
    return data + b"\n" + hashlib.sha256(data).hexdigest().encode()


def _made(write: Callable[[Path], object], suffix: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"seed{suffix}"
        write(path)
        return path.read_bytes()


def _parquet() -> bytes:
    csv = Path(tempfile.mkdtemp()) / "seed.csv"
    csv.write_bytes(RECORDING)
    return _made(lambda path: write_recording(read_recording(csv), path), ".parquet")


def _workbook() -> bytes:
    write_workbook = runpy.run_path(str(ROOT / "tests" / "support" / "workbook.py"))["write_workbook"]
    return _made(lambda path: write_workbook(path, [line.split(";") for line in EXPORT.splitlines()]), ".xlsx")


def _audit() -> bytes:
    lines: list[str] = []
    audit = LineAudit(None, lines.append)
    for act in ("acknowledge", "shelve"):
        audit.write(0, act=act, by="ada")
    return "\n".join(lines).encode()


def _message(**fields: object) -> bytes:
    return json.dumps({"station": "alpha", "time": STAMP} | fields).encode()


def _messages() -> dict[str, Parser]:
    sample = (EXAMPLES / "sample.json").read_bytes()
    block = SampleBlock.of([Sample.decode(sample)] * 2).encode()
    plan = Plan(time=0, shard=0, epoch=0, stations=(find_station("alpha"),)).encode()
    curve = {"flow_m3h": [0.0, 100.0], "head_m": [36.0, 32.0]}
    levels = {"nominal_frequency_hz": 50.0, "start_levels_m": [1.6], "stop_levels_m": [0.5], "floor_area_m2": 8.0}
    pump = {"pump": 1, "configured_pump": curve, "configured_system": curve}
    gap = {
        "gap": {"flow": 1.0},
        "matters": 0.4,
        "interval": [0.1, 0.7],
        "group": "flow/1/steady",
        "first_matters": 0.2,
    }
    by = {"id": "1", "by": "ada"}
    seeds: Mapping[type[Message], bytes] = {
        Sample: sample,
        SampleBlock: block,
        Verdict: (EXAMPLES / "verdict.json").read_bytes(),
        Alarm: (EXAMPLES / "alarm.json").read_bytes(),
        AlarmAct: _message(alarm="a", act="acknowledge", **by),
        HistoryQuery: _message(kind="kpi", start=STAMP, end="2026-01-02T00:00:00Z"),
        Order: _message(pump=1, act="rebaseline", **by),
        Plan: plan,
        MaintenanceAct: _message(asset="pump:2", act="pump cleaned", **by),
        PlantClockOrder: _message(speed=60.0, is_held=False, look_s=5.0),
        Status: _message(service="detector", state="running", figures={"samples": 1.0}),
        Model: _message(pumps=[pump], **levels),
        GapWatch: _message(**gap),
    }
    return {
        f"bus_{kind.__name__}": Parser(lambda kind=kind: kind.decode, [seed, DEEP]) for kind, seed in seeds.items()
    }


def _kept() -> dict[str, Parser]:
    detector = Detector.of(find_station("alpha"))
    place = Kept()
    Checkpoint(place).save(detector, Told({}))
    alarms = alarm_state.SiteState().model_dump_json().encode()
    watch = WatchState(station=find_station("alpha")).model_dump_json().encode()
    body = detector.snapshot().partition(b"\n")[2].rstrip(b"\n")
    return {
        "snapshot": Parser(lambda: detector.restore, [detector.snapshot(), DEEP]),
        "snapshot_sealed": Parser(lambda: sealed_snapshot, [body, DEEP]),
        "checkpoint": Parser(lambda: checkpoint, [place.data, DEEP]),
        "alarm_state": Parser(of_state(alarm_state.read_state), [alarms, DEEP]),
        "watch_state": Parser(of_state(lambda data: watch_state.read_state(sealed(data))), [watch, DEEP]),
        "audit": Parser(
            lambda: lambda data: broken_among(data.decode(errors="replace").splitlines()), [_audit(), DEEP]
        ),
    }


def _files() -> dict[str, Parser]:
    mapping = [(EXAMPLES / name).read_bytes() for name in ("mapping.toml", "mapping-wide.toml", "mapping-main.toml")]
    tokens = _made(lambda path: new_token(path, "ada", "viewer", 1), ".toml")
    toml = b"a = " + DEEP
    return {
        "mapping": Parser(of_file(load_mapping, ".toml"), [*mapping, toml]),
        "station": Parser(
            of_file(lambda path: find_station(str(path)), ".toml"), [(EXAMPLES / "station.toml").read_bytes(), toml]
        ),
        "scenario": Parser(
            of_file(lambda path: find_scenario(str(path)), ".toml"), [(EXAMPLES / "scenario.toml").read_bytes(), toml]
        ),
        "settings": Parser(of_file(load_settings, ".toml"), [(EXAMPLES / "settings.toml").read_bytes(), toml]),
        "access": Parser(
            of_file(load_access, ".toml"), [(ROOT / "services" / "security" / "access.toml").read_bytes(), toml]
        ),
        "tokens": Parser(of_file(read_holders, ".toml"), [tokens, toml]),
        "plc": Parser(of_file(load_plcs, ".toml"), [PLC, toml]),
        "register_map": Parser(
            of_file(lambda path: read_map_csv(path, 2), ".csv"),
            [b"name,table,address,type\nlevel_m,holding,0,float32\npump1_running,coil,0,bit\n"],
        ),
        "recording": Parser(of_file(read_recording, ".csv"), [RECORDING]),
        "recording_parquet": Parser(of_file(read_recording, ".parquet"), [_parquet()]),
        "export": Parser(of_file(lambda path: convert([path], EXPORT_MAPPING), ".csv"), [EXPORT.encode()]),
        "export_excel": Parser(of_file(lambda path: convert([path], EXPORT_MAPPING), ".xlsx"), [_workbook()]),
    }


def _links() -> dict[str, Parser]:
    act = _message(alarm="a", act="acknowledge", id="1", by="ada")
    requests = [
        b"GET /api/stations/alpha/trends?from=2026-01-01T00:00:00Z&to=2026-01-02T00:00:00Z&points=10\n\n",
        b"GET /api/stations/alpha/history?kind=verdicts&last=3\nauthorization: Bearer x\n\n",
        b"POST /api/stations/alpha/alarm-act\ncontent-type: application/json\n\n" + act,
        b'POST /api/login\ncontent-type: application/json\n\n{"token":"x"}',
        b"POST /api/login\ncontent-type: application/json\n\n" + DEEP,
        b"GET /reports/a/b.html\ncookie: wetwell_token=x\n\n",
    ]
    page = Page(b"8 bytes.", 7, 9, (b"seven", b"eight")).encode()
    cached = [
        bytes([len(page[1])]) + page[1] + page[0],
        PublisherCache(history=1).add(b""),
        b'{"source":"","begin":0}',
    ]
    answer = b"\x00" + bytes.fromhex("00010000000701030400013f80")
    return {
        "bus_page": Parser(lambda: cached_messages, [*cached, DEEP]),
        "modbus": Parser(modbus, [REQUEST, WRITE]),
        "modbus_answer": Parser(lambda: modbus_answer, [answer]),
        "http": Parser(http, requests),
    }


def parsers() -> dict[str, Parser]:
    """Each parser by its name."""
    return {**_files(), **_messages(), **_kept(), **_links()}
