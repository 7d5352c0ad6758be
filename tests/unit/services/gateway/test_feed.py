"""Polls become samples: supervision, clocks, figures; and the detector does not know that a PLC was between."""

import copy

import numpy as np
import pytest

from wetwell.protocols.errors import LinkError
from wetwell.protocols.modbus.client import NoAnswerError
from wetwell.protocols.modbus.device_map import Device, Plc
from wetwell.protocols.modbus.device_signal import Signal
from wetwell.protocols.modbus.registers import encode, register_table
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.protocols.units import house_unit
from wetwell.services.gateway.feed import StationFeed
from wetwell.services.gateway.poll import Poll
from wetwell.simulator.faults import Blockage
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

STAMP_NS = 1_800_000_000 * NS_PER_S
OWN = {row.name: row for row in register_table(3, 3) if row.table == "input"}


def feed_of(*names, **device):
    signals = {name: Signal(address=n) for n, name in enumerate(names)}
    device = Device(station="s", host="h", signal=signals, **device)
    return StationFeed(Plc(station="s", pumps=1, device=device, signals=signals))


def take(feed, values, now_s=0.0, latency_s=0.01):
    return feed.handle_poll(Poll(values=values), STAMP_NS, latency_s, now_s)


def test_samples_count_and_bear_the_time_of_the_poll():
    feed = feed_of("level_m")
    samples = [take(feed, {"level_m": level_m}) for level_m in (1.0, None)]
    assert [(sample.seq, sample.time, sample.level_m) for sample in samples] == [
        (0, STAMP_NS, 1.0),
        (1, STAMP_NS, None),
    ]
    assert samples[0].pumps[0].running is None


def test_the_clock_of_the_plc_counts_where_asked_for():
    feed = feed_of("level_m", "time_s", clock="plc")
    assert take(feed, {"time_s": 1_700_000_000.0}).time == 1_700_000_000 * NS_PER_S
    assert take(feed, {"time_s": None}) is None
    assert take(feed, {"time_s": 0.0}) is None
    assert take(feed, {"time_s": 1e300}) is None
    assert take(feed, {"time_s": 1_700_000_001.0}).seq == 1
    assert feed.figures(0.0)["without_time"] == 3


@pytest.mark.parametrize(("running", "frequency_hz"), [(1.0, 49.2), (0.0, 0.0), (None, None)])
def test_a_pump_without_drive_has_its_fixed_frequency_while_it_runs(running, frequency_hz):
    feed = feed_of("pump1_running", fixed_frequency_hz=49.2)
    assert take(feed, {"pump1_running": running}).pumps[0].frequency_hz == frequency_hz
    feed = feed_of("pump1_running", "pump1_frequency_hz", fixed_frequency_hz=49.2)
    values = {"pump1_running": running, "pump1_frequency_hz": None}
    assert take(feed, values).pumps[0].frequency_hz is None, "a drive that says nothing is no fixed one"


def test_a_heartbeat_that_stands_or_is_missing_from_the_first_poll_on():
    for beat in (7.0, None):
        feed = feed_of("heartbeat", heartbeat_s=10.0)
        qualities = [take(feed, {"heartbeat": beat}, now_s).quality for now_s in (0.0, 9.9, 10.0, 20.0)]
        assert qualities == ["good", "good", "bad", "bad"]
        assert feed.condition(20.0) == ("running", "heartbeat stands for 20 s")
        assert take(feed, {"heartbeat": 8.0}, 21.0).quality == "good"
        assert feed.condition(21.0) == ("running", "")
        assert feed.figures(23.0)["heartbeat_age_s"] == 2.0


def test_figures_and_states_from_start_to_loss_and_back():
    feed = feed_of("level_m")
    assert feed.condition(0.0) == ("starting", "")
    feed.connected()
    for n in range(100):
        feed.due(0.001 * n, skipped=0)
        take(feed, {"level_m": 1.0}, now_s=float(n), latency_s=0.001 * (n + 1))
    figures = feed.figures(100.0)
    assert (figures["latency_p50_s"], figures["latency_p99_s"]) == (pytest.approx(0.051), pytest.approx(0.1))
    assert (figures["polls"], figures["good_polls"], figures["reconnects"]) == (100.0, 100.0, 0.0)
    assert figures["last_good_poll_age_s"] == 1.0
    feed.fail(NoAnswerError("input 0: no answer within 1 s"), 101.0)
    feed.fail(LinkError("cannot connect: no route to host"), 105.0)
    said = "Modbus TCP h:502 unit 1: cannot connect: no route to host, for 60 s"
    assert feed.condition(161.0) == ("waiting", said)
    feed.connected()
    take(feed, {"level_m": 1.0}, now_s=162.0)
    assert feed.condition(162.0) == ("running", "")
    figures = feed.figures(162.0)
    assert (figures["timeouts"], figures["failed_connections"], figures["reconnects"]) == (1.0, 1.0, 1.0)


def polled(recording):
    """What a gateway makes of a PLC that shows each second of a recording."""
    signals = {name: Signal(table="input", address=row.address, type=row.type) for name, row in OWN.items()}
    device = Device(station="alpha", host="h", clock="plc", signal=signals)
    feed = StationFeed(Plc(station="alpha", pumps=3, device=device, signals=signals))
    columns = {name: column.tolist() for name, column in recording.columns.items()}
    for n, stamp_ns in enumerate(recording.time_ns.tolist()):
        shown = {name: column[n] for name, column in columns.items()}
        shown |= {"heartbeat": n % 65536, "time_s": stamp_ns // NS_PER_S}
        words = {name: encode(OWN[name], value, "ABCD") for name, value in shown.items()}
        values = {name: signals[name].value(words[name], "ABCD", house_unit(name)) for name in words}
        yield feed.handle_poll(Poll(values=values), 0, 0.0, float(n))


def test_the_detector_says_the_same_of_a_plc_as_of_the_simulator(alpha, learnt):
    fault = Blockage(pump=2, speed_loss=0.2, start_s=24_000.0, end_s=25_000.0, after="hold")
    simulation = Simulation(alpha, Scenario(name="blocked", fault=(fault,)), 3)
    simulation.advance(24_000)
    recording = simulation.advance(6_000, truth=False)
    verdicts = {}
    for path, samples in (("simulator", recording.samples("alpha", 24_000)), ("plc", polled(recording))):
        detector = copy.deepcopy(learnt)
        verdicts[path] = [verdict for sample in samples for verdict in detector.update(sample)]
    told = {path: [(each.time, each.pump, each.state) for each in listed] for path, listed in verdicts.items()}
    assert told["plc"] == told["simulator"]
    assert "pump_fault" in {state for _, pump, state in told["plc"] if pump == 2}
    for plc, simulator in zip(verdicts["plc"], verdicts["simulator"], strict=True):
        assert plc.probability == pytest.approx(simulator.probability, abs=1e-3)


def test_samples_of_a_plc_are_those_of_the_simulator_up_to_32_bit(alpha):
    recording = Simulation(alpha, Scenario(name="healthy"), 3).advance(600, truth=False)
    for plc, simulator in zip(polled(recording), recording.samples("alpha"), strict=True):
        assert plc.time == simulator.time
        assert plc.level_m == np.float32(simulator.level_m)
        for ours, theirs in zip(plc.pumps, simulator.pumps, strict=True):
            assert ours.running == theirs.running
            assert ours.head_m == np.float32(theirs.head_m)
            assert ours.flow_m3h == np.float32(theirs.flow_m3h)
