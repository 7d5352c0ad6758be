"""Every parser fed with inputs that nobody would send, guided by the code that they reach (atheris, libFuzzer).

    python benchmarks/fuzz.py --inputs 1000000 [--target mapping] [--seed 1]

A target may refuse an input with an error of the project and must not raise anything else; the Modbus server must go
on, and the page must answer with a status below 500, or 503. Each target is a process of its own, which begins with
inputs as they should be. `findings` holds what broke the rule: the input in hexadecimal, and the last line of the
traceback; exit code 1 if there are any. `edges` is how much code was reached. Needs `pip install atheris` (Linux).
"""

import argparse
import asyncio
import contextlib
import json
import logging
import platform
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

try:
    import atheris
except ImportError:
    sys.exit("atheris is not installed: pip install atheris")

with atheris.instrument_imports(include=["wetwell.protocols", "wetwell.services.dashboard", "pymodbus"]):
    from wetwell.detector.detector import Detector
    from wetwell.protocols.errors import WetwellError
    from wetwell.protocols.messages.alarm import AlarmAct
    from wetwell.protocols.messages.history import HistoryQuery
    from wetwell.protocols.messages.sample import PumpReading, Sample
    from wetwell.protocols.messages.sample_block import SampleBlock
    from wetwell.protocols.messages.verdict import Verdict
    from wetwell.protocols.modbus.device_csv import read_map_csv
    from wetwell.protocols.modbus.server import ModbusServer
    from wetwell.protocols.recordings.importers.conversion import convert
    from wetwell.protocols.recordings.importers.mapping import TagMapping, load_mapping
    from wetwell.protocols.recordings.recording import read_recording
    from wetwell.protocols.station.station_file import load_station
    from wetwell.services.dashboard.app import AppState, dashboard_app
    from wetwell.services.dashboard.event_streams import EventStreams
    from wetwell.services.dashboard.view.site_view import SiteView
    from wetwell.services.stations import find_station

ROOT = Path(__file__).parents[1]
MAPPING = ROOT / "benchmarks" / "real_station" / "mapping.toml"
STATION = ROOT / "simulator" / "stations" / "alpha.toml"
SAMPLE = Sample(station="alpha", seq=1, time=0, level_m=1.5, pumps=(PumpReading(flow_m3h=200.0, running=True),))
RECORDING = b"time,level_m,pump1_flow_m3h\n2026-01-01T00:00:00Z,1.5,200\n2026-01-01T00:00:01Z,1.4,\n"
EXPORT = "Zeit;Füllstand;Durchfluss\n27.10.2024 02:50:00;120,5;40\n27.10.2024 02:00:00;122,4;\n".encode()
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
REQUEST = bytes.fromhex("000100000006010300000002")
WRITE = bytes.fromhex("00020000000b011000640002043f800000")
ANSWERED = {*range(200, 500), 503}

Target = Callable[[bytes], object]


def of_file(read: Callable[[Path], object], suffix: str) -> Target:
    """A reader of files."""
    path = Path(tempfile.mkdtemp()) / f"input{suffix}"

    def feed(data: bytes) -> None:
        path.write_bytes(data)
        read(path)

    return feed


def modbus() -> Target:
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


def http() -> Target:
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


def targets() -> dict[str, tuple[Callable[[], Target], list[bytes]]]:
    """Each parser: how it is made ready, and inputs as they should be."""
    detector = Detector.of(find_station("alpha"))
    act = b'{"schema":"wetwell.alarm-act/1","alarm":"a","act":"acknowledge","by":"ada"}'
    requests = [
        b"GET /api/stations/alpha/trends?from=2026-01-01T00:00:00Z&to=2026-01-02T00:00:00Z&points=10\n\n",
        b"GET /api/stations/alpha/history?kind=verdicts&last=3\nauthorization: Bearer x\n\n",
        b"POST /api/stations/alpha/alarm-act\ncontent-type: application/json\n\n" + act,
        b'POST /api/login\ncontent-type: application/json\n\n{"token":"x"}',
        b"GET /reports/a/b.html\ncookie: wetwell_token=x\n\n",
    ]
    return {
        "mapping": (lambda: of_file(load_mapping, ".toml"), [MAPPING.read_bytes()]),
        "station": (lambda: of_file(load_station, ".toml"), [STATION.read_bytes()]),
        "recording": (lambda: of_file(read_recording, ".csv"), [RECORDING]),
        "export": (lambda: of_file(lambda path: convert([path], EXPORT_MAPPING), ".csv"), [EXPORT]),
        "register_map": (
            lambda: of_file(lambda path: read_map_csv(path, 2), ".csv"),
            [b"name,table,address,type\nlevel_m,holding,0,float32\npump1_running,coil,0,bool\n"],
        ),
        "sample": (lambda: Sample.decode, [SAMPLE.encode()]),
        "samples": (lambda: SampleBlock.decode, [SampleBlock.of([SAMPLE, SAMPLE]).encode()]),
        "verdict": (
            lambda: Verdict.decode,
            [b'{"schema":"wetwell.verdict/1","station":"alpha","pump":1}'],
        ),
        "question": (lambda: HistoryQuery.decode, [b'{"kind":"kpi","from":"2026-01-01T00:00:00Z"}']),
        "alarm_act": (lambda: AlarmAct.decode, [act]),
        "snapshot": (lambda: detector.restore, [detector.snapshot()]),
        "modbus": (modbus, [REQUEST, WRITE]),
        "http": (http, requests),
    }


def fuzz(name: str, folder: Path, inputs: int, seed: int) -> None:
    """Feed one target in this process, which libFuzzer ends."""
    logging.disable()
    make, seeds = targets()[name]
    target = make()
    corpus = folder / "corpus"
    corpus.mkdir()
    for number, data in enumerate(seeds):
        (corpus / str(number)).write_bytes(data)

    def feed(data: bytes) -> None:
        with contextlib.suppress(WetwellError):
            target(data)

    options = ["-print_final_stats=1", "-len_control=0", f"-artifact_prefix={folder}/"]
    options += [f"-runs={inputs}", f"-seed={seed}"]
    atheris.Setup([sys.argv[0], *options, str(corpus)], feed)
    atheris.Fuzz()


def run(name: str, inputs: int, seed: int) -> dict[str, Any]:
    """Figures of one target."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, __file__, "--inputs", str(inputs), "--seed", str(seed), "--feed", name, folder]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)  # noqa: S603
        told = done.stdout + done.stderr
        crashes = [file for file in Path(folder).iterdir() if file.is_file()]
        lines = re.findall(r"^(?:Uncaught Python exception.*|\w[\w.]*(?:Error|Exception)\b.*)$", told, re.MULTILINE)
        findings = [
            {"input": file.read_bytes()[:2000].hex(), "error": (lines or [told[-300:]])[-1]} for file in crashes
        ]
        if done.returncode and not findings:
            findings = [{"input": "", "error": told[-500:]}]
    executed = re.findall(r"stat::number_of_executed_units: (\d+)", told)
    rate = re.findall(r"stat::average_exec_per_sec: +(\d+)", told)
    edges = re.findall(r"cov: (\d+)", told)
    return {
        "inputs": int(executed[-1]) if executed else 0,
        "per_second": int(rate[-1]) if rate else 0,
        "edges": int(edges[-1]) if edges else 0,
        "findings": findings,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=1_000_000, help="over all targets")
    parser.add_argument("--target", action="append", help="only this one")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--feed", nargs=2, metavar=("TARGET", "FOLDER"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.feed:
        fuzz(arguments.feed[0], Path(arguments.feed[1]), arguments.inputs, arguments.seed)
        return
    names = arguments.target or list(targets())
    each = -(-arguments.inputs // len(names))
    about = {"benchmark": "fuzz", "seed": arguments.seed, "python": platform.python_version()}
    figures = {name: run(name, each, arguments.seed) for name in names}
    findings = sum(len(figure["findings"]) for figure in figures.values())
    total = sum(figure["inputs"] for figure in figures.values())
    print(json.dumps(about | {"inputs": total, "findings": findings, "targets": figures}, indent=2))
    sys.exit(findings > 0)


if __name__ == "__main__":
    main()
