"""PLC, gateway and detector as processes: on the bus a polled station is like a simulated one."""

import contextlib
import json
import os
import subprocess
import sys
import time

import numpy as np
import pytest
import zenoh
from ports import free_port

pytestmark = pytest.mark.check

SPEED = 20
SAMPLES = 30
DEADLINE_S = 90.0
SCENARIO = 'name = "soon"\ninitial_level_m = 1.9\ninflow = {kind = "empirical"}\n'


@contextlib.contextmanager
def wetwell(*arguments):
    process = subprocess.Popen(
        [sys.executable, "-m", "wetwell.services", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"WETWELL_HEALTH__PERIOD_S": "0.5", "WETWELL_GATEWAY__LONGEST_WAIT_S": "0.5"},
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@contextlib.contextmanager
def messages(port, key):
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["tcp/127.0.0.1:{port}"]')
    config.insert_json5("connect/timeout_ms", "30000")
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as session:
        yield session.declare_subscriber(key)


def received(subscriber):
    end = time.monotonic() + DEADLINE_S
    while time.monotonic() < end:
        message = subscriber.try_recv()
        if message is None:
            time.sleep(0.005)  # real peers in other processes: there is no virtual time here
        else:
            yield str(message.key_expr), json.loads(message.payload.to_string())
    raise AssertionError("nothing more came in time")


def station(sample):
    return [np.float32(sample[name]) for name in ("level_m", "inflow_m3h")]


def pumps(sample):
    return [[np.float32(value) for value in pump.values()] for pump in sample["pumps"]]


def test_samples_of_the_gateway_are_those_of_the_simulator_and_are_judged(tmp_path):
    zenoh_port, modbus_port = free_port(), free_port()
    endpoint = f"tcp/127.0.0.1:{zenoh_port}"
    (tmp_path / "soon.toml").write_text(SCENARIO)
    station_file = tmp_path / "polled.toml"
    shown = subprocess.run(
        [sys.executable, "-m", "wetwell.services", "modbus-map"], check=True, capture_output=True, text=True
    )
    (tmp_path / "map.csv").write_text(shown.stdout)
    curve = "curve = [36.0, -0.02333, -1.3333e-4]"
    station_file.write_text(f'name = "polled"\nsump.area_m2 = 8.0\npump = [{{{curve}}}, {{{curve}}}, {{{curve}}}]\n')
    (tmp_path / "plc.toml").write_text(
        f'station_file = "polled.toml"\nhost = "127.0.0.1"\nport = {modbus_port}\nmap = "map.csv"\n'
        'period_s = 0.02\nclock = "plc"\n'
    )
    live = ["--scenario", tmp_path / "soon.toml", "--speed", SPEED, "--seed", 5, "--modbus-server"]
    with (
        wetwell("router", "--zenoh", endpoint),
        messages(zenoh_port, "wetwell/**") as subscriber,
        wetwell("detector", "--station", station_file, "--zenoh", endpoint),
        wetwell("gateway", "--plc", tmp_path / "plc.toml", "--zenoh", endpoint) as gateway,
        wetwell("simulator", *live, "--modbus", f"127.0.0.1:{modbus_port}", "--zenoh", endpoint),
    ):
        simulated, polled, states = {}, {}, set()
        status = {}
        for key, message in received(subscriber):
            if key == "wetwell/alpha/sample":
                simulated[message["time"]] = message
            elif key == "wetwell/polled/sample" and message["level_m"] is not None:
                polled.setdefault(message["time"], message)
            elif key == "wetwell/polled/status/gateway":
                status = message
            elif key.startswith("wetwell/polled/verdict"):
                states.add((message["pump"], message["state"], message["time"][:10]))
            whole = [
                stamp
                for stamp, sample in polled.items()
                if sample["pumps"][0]["running"] and stamp in simulated and pumps(sample) == pumps(simulated[stamp])
            ]
            if len(whole) > SAMPLES and len(states) == 3 and status and simulated.keys() >= polled.keys():
                break
        gateway.terminate()
        _, err = gateway.communicate(timeout=20)
        assert gateway.returncode == 0, err
        assert "Traceback" not in err
    assert states == {(pump, "learning", "2025-01-01") for pump in (1, 2, 3)}
    assert status["state"] == "running"
    assert status["figures"]["good_polls"] > SAMPLES
    times = list(simulated)
    for stamp, sample in polled.items():
        assert station(sample) == station(simulated[stamp])
        later = (simulated[second] for second in times[times.index(stamp) :])
        assert any(pumps(sample) == pumps(each) for each in later), "the second request is not older than the first"
