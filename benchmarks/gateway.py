"""CPU share and lateness of one gateway process that polls 1,000 PLCs at 1 Hz; another process plays all of them."""

import argparse
import asyncio
import json
import multiprocessing
import os
import platform
import resource
import socket
import statistics
import struct
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from types import MappingProxyType
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

from memory_bus import MemoryBus
from pymodbus.client import AsyncModbusTcpClient

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.zenoh.link import ZenohBus, connect_client, open_router
from wetwell.protocols.messages.status import Status
from wetwell.protocols.modbus.device_map import Device, Plc
from wetwell.protocols.modbus.device_signal import Signal
from wetwell.protocols.modbus.registers import register_table
from wetwell.services.gateway.daemon import poll_all

PUMPS = 3
WARM_UP_S = 10.0
BLOCKS = ((0, 8), (100, 49))
"""The requests by which the gateway reads the project's own map of three pumps."""


class PlcProtocol(asyncio.Protocol):
    """Answers every read of registers: 1.0 in each float, a heartbeat that follows the clock."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport: Any = transport

    def data_received(self, data: bytes) -> None:
        transaction, _, _, unit, function, address, count = struct.unpack(">HHHBBHH", data[:12])
        words = bytearray(b"\x3f\x80\x00\x00" * (count // 2 + 1))[: 2 * count]
        if address == 0:
            words[8:10] = struct.pack(">H", int(time.monotonic()) % 65536)
        self.transport.write(struct.pack(">HHHBBB", transaction, 0, 3 + 2 * count, unit, function, 2 * count) + words)


def play_plcs(listener: socket.socket) -> None:
    async def serve() -> None:
        server = await asyncio.get_running_loop().create_server(PlcProtocol, sock=listener, backlog=4096)
        await server.serve_forever()

    asyncio.run(serve())


def route(endpoint: str) -> None:
    with open_router(endpoint):
        time.sleep(3600.0)


def plcs_at(port: int, count: int) -> list[Plc]:
    signals = MappingProxyType(
        {
            row.name: Signal(table="input", address=row.address, type=row.type)
            for row in register_table(PUMPS, PUMPS)
            if row.table == "input" and row.type != "bit"
        }
    )
    names = [f"s{n}" for n in range(count)]
    devices = [
        Device(station=name, host="127.0.0.1", port=port, unit_id=n % 248, answer_timeout_s=5.0)
        for n, name in enumerate(names)
    ]
    return [
        Plc(station=name, pumps=PUMPS, device=device, signals=signals)
        for name, device in zip(names, devices, strict=True)
    ]


async def gateway_figures(bus: Bus, plcs: list[Plc], seconds: float) -> dict[str, float]:
    """Run the gateway on a bus; figures of the time after the start."""
    statuses = bus.subscribe("wetwell/*/status/gateway", capacity=100_000)
    samples = bus.subscribe("wetwell/*/sample", capacity=1_000_000)
    polling = asyncio.create_task(poll_all(bus, plcs, 5.0, 30.0))
    await asyncio.sleep(WARM_UP_S)
    await samples.receive()
    cpu_s, wall_s = time.process_time(), time.monotonic()
    await asyncio.sleep(seconds)
    cpu_s, wall_s = time.process_time() - cpu_s, time.monotonic() - wall_s
    published = len(await samples.receive())
    latest: dict[str, dict[str, float]] = {}
    for payload in await statuses.receive():
        status = Status.decode(payload)
        latest[status.station] = status.figures
    polling.cancel()
    await asyncio.gather(polling, return_exceptions=True)
    site = latest.pop("_site")
    figures = {
        "cpu_share": round(cpu_s / wall_s, 3),
        "cpu_ms_per_sample": round(1000.0 * cpu_s / published, 3),
        "samples_per_s": round(published / wall_s, 1),
        "plcs_waiting": site["plcs_waiting"],
        "skipped_polls": sum(each.get("skipped_polls", 0.0) for each in latest.values()),
    }
    for name in ("delay_p50_s", "delay_p99_s", "latency_p50_s", "latency_p99_s"):
        values = [each[name] for each in latest.values() if name in each]
        figures[f"{name}_of_the_median_plc"] = round(statistics.median(values), 5)
        figures[f"{name}_of_the_worst_plc"] = round(max(values), 5)
    return figures


async def pymodbus_ms(port: int, count: int, seconds: float) -> float:
    """CPU time of pymodbus' own client that only reads the same registers, for each poll. [ms]."""

    async def read(index: int, start_s: float) -> None:
        loop = asyncio.get_running_loop()
        client = AsyncModbusTcpClient("127.0.0.1", port=port, retries=0, reconnect_delay=0, timeout=5.0)
        while not await client.connect():  # noqa: ASYNC110 - a listener has no event
            await asyncio.sleep(0.1)
        for n in range(round(seconds)):
            await asyncio.sleep(max(0.0, start_s + n + index / count - loop.time()))
            for address, words in BLOCKS:
                await client.read_input_registers(address, count=words, device_id=index % 248)
        client.close()

    start_s = asyncio.get_running_loop().time() + WARM_UP_S
    tasks = [asyncio.create_task(read(index, start_s)) for index in range(count)]
    await asyncio.sleep(WARM_UP_S)
    cpu_s = time.process_time()
    await asyncio.gather(*tasks)
    return round(1000.0 * (time.process_time() - cpu_s) / (count * round(seconds)), 3)


async def on_zenoh(endpoint: str, plcs: list[Plc], seconds: float) -> dict[str, float]:
    bus: ZenohBus = await connect_client(endpoint)
    with bus:
        return await gateway_figures(bus, plcs, seconds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plcs", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=30.0)
    arguments = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(65536, resource.getrlimit(resource.RLIMIT_NOFILE)[1]),) * 2)
    with ExitStack() as stack:
        listener = stack.enter_context(socket.create_server(("127.0.0.1", 0), backlog=4096))
        free = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        port, endpoint = listener.getsockname()[1], f"tcp/127.0.0.1:{free.getsockname()[1]}"
        free.close()
        for target, argument in ((play_plcs, listener), (route, endpoint)):
            process = multiprocessing.Process(target=target, args=(argument,), daemon=True)
            process.start()
            stack.callback(process.kill)
        plcs = plcs_at(port, arguments.plcs)
        load = os.getloadavg()[0]
        results = {
            "gateway_on_zenoh": asyncio.run(on_zenoh(endpoint, plcs, arguments.seconds)),
            "gateway_in_memory": asyncio.run(gateway_figures(MemoryBus(), plcs, arguments.seconds)),
            "pymodbus_client_alone_ms_per_poll": asyncio.run(pymodbus_ms(port, arguments.plcs, arguments.seconds)),
            "memory_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0),
        }
    machine = {"cores": os.cpu_count(), "python": platform.python_version(), "load_before": load}
    print(json.dumps({"plcs": arguments.plcs, "seconds": arguments.seconds} | results | machine, indent=2))


if __name__ == "__main__":
    main()
