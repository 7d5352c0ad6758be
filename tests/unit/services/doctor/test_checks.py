"""What the doctor says of a site, by what is broken in it."""

import asyncio

import pytest
from memory_bus import MemoryBus

from wetwell.protocols.bus.keys import sample_block_key
from wetwell.protocols.messages.alarm import AlarmFigure, AlarmReport
from wetwell.protocols.messages.history import History
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.messages.status import Status
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.doctor.checks import findings_of
from wetwell.services.doctor.finding import exit_code
from wetwell.services.doctor.survey import Survey, listen

NOW_NS = 1_800_000_000 * NS_PER_S
READING = PumpReading(frequency_hz=50.0, flow_m3h=200.0, head_m=20.0)


def sample(number: int, shift_s: float = 0.0, **change) -> tuple[int, Sample]:
    heard_ns = NOW_NS + number * NS_PER_S
    fields = {"station": "alpha", "seq": number, "level_m": 1.0, "pumps": (READING,)}
    return heard_ns, Sample.model_validate(fields | {"time": heard_ns + round(shift_s * NS_PER_S)} | change)


def site() -> Survey:
    """A site on which all is well."""
    verdict = Verdict(
        time=NOW_NS, station="alpha", pump=1, state="normal", probability={}, evidence={}, window=(0, NOW_NS)
    )
    return Survey(
        seconds=5.0,
        samples={"alpha": [sample(number) for number in range(5)]},
        verdicts={("alpha", 1): verdict},
        statuses={("alpha", "detector"): status(sample_age_s=1.0, dropped=0.0)},
        alive={("alpha", "detector"), *(("_site", name) for name in ("historian", "alarms", "watch", "dashboard"))},
        histories={"alpha": History(station="alpha", kind="samples")},
        report=AlarmReport(time=NOW_NS, rates={"is_flood": 0.0}, standing={"unacknowledged": 1}),
    )


def status(state="running", **figures) -> Status:
    return Status(time=NOW_NS, station="alpha", service="detector", state=state, figures=figures)


def alter(survey: Survey, **change) -> None:
    survey.samples["alpha"] = [sample(number, **change) for number in range(5)]


BROKEN = {
    "no samples": (lambda survey: survey.samples.clear(), 2, "station 'alpha': no sample within 5 s"),
    "clock": (lambda survey: alter(survey, shift_s=-3600.0), 1, "samples are -3600.0 s from this clock"),
    "quality": (lambda survey: alter(survey, quality="bad"), 1, "100% of the samples are not of good quality"),
    "no level": (lambda survey: alter(survey, level_m=None), 1, "never a value of level_m"),
    "no head": (
        lambda survey: alter(survey, pumps=(READING.model_copy(update={"head_m": None}),)),
        1,
        "never a value of pump1_head_m",
    ),
    "no detector": (lambda survey: survey.alive.discard(("alpha", "detector")), 2, "no detector is running"),
    "no verdict": (lambda survey: survey.verdicts.clear(), 1, "no verdict yet"),
    "old verdict": (lambda survey: alter(survey, shift_s=90_000.0), 1, "pump 1: normal, 25.0 h ago"),
    "historian hangs": (lambda survey: survey.histories.clear(), 2, "the historian does not answer"),
    "no historian": (
        lambda survey: (survey.histories.clear(), survey.alive.discard(("_site", "historian"))),
        1,
        "historian is not running",
    ),
    "database": (
        lambda survey: survey.histories.update(alpha=History(station="alpha", kind="samples", error="disk full")),
        2,
        "station 'alpha': disk full",
    ),
    "alarms hang": (lambda survey: setattr(survey, "report", None), 2, "alarms runs but does not answer"),
    "no alarms": (
        lambda survey: (setattr(survey, "report", None), survey.alive.discard(("_site", "alarms"))),
        1,
        "alarms is not running",
    ),
    "flood": (lambda survey: survey.report.rates.update(is_flood=1.0), 1, "there is an alarm flood"),
    "chattering": (
        lambda survey: setattr(
            survey,
            "report",
            survey.report.model_copy(
                update={"chattering": (AlarmFigure(station="alpha", alarm="level_high", transitions=12),)}
            ),
        ),
        1,
        "station 'alpha': level_high chatters, 12 changes within the hour",
    ),
    "too slow": (
        lambda survey: survey.statuses.update({("alpha", "detector"): status(dropped=7.0)}),
        2,
        "detector of 'alpha': 7 messages dropped since its start",
    ),
    "starved": (
        lambda survey: survey.statuses.update({("alpha", "detector"): status(sample_age_s=90.0)}),
        2,
        "detector of 'alpha': no sample for 90 s",
    ),
    "waiting": (
        lambda survey: survey.statuses.update({("alpha", "detector"): status("waiting")}),
        2,
        "detector of 'alpha': waits: what it needs does not answer",
    ),
    "disk": (
        lambda survey: survey.statuses.update({("alpha", "detector"): status(disk_free_bytes=5e6)}),
        2,
        "only 5 MB are free on its disk",
    ),
}


def test_where_all_is_well_nothing_is_found():
    findings = list(findings_of(site(), ["alpha"], 60.0))
    assert exit_code(findings) == 0
    assert {finding.check for finding in findings} == {
        "samples",
        "clock",
        "quality",
        "verdicts",
        "history",
        "services",
        "alarms",
    }


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_broken_is_named_with_what_to_do(name):
    spoil, code, said = BROKEN[name]
    survey = site()
    spoil(survey)
    findings = list(findings_of(survey, ["alpha"], 60.0))
    told = [finding for finding in findings if said in finding.text]
    assert told, [finding.text for finding in findings]
    assert all(finding.advice and finding.level != "ok" for finding in told)
    assert exit_code(findings) == code


def test_a_missing_station_and_an_empty_bus_are_errors_and_fast_time_is_no_skew():
    assert exit_code(list(findings_of(Survey(5.0), [], 60.0))) == 2
    assert "station 'beta': no sample" in str(list(findings_of(site(), ["alpha", "beta"], 60.0)))
    fast = site()
    fast.samples["alpha"] = [sample(number, shift_s=600.0 * number) for number in range(5)]
    (clock,) = [finding for finding in findings_of(fast, ["alpha"], 60.0) if finding.check == "clock"]
    assert (clock.level, "481 times as fast as life" in clock.text) == ("ok", True)


def gathered(message_s: int, seconds: float = 5.0, start_s: float = 3.0, pace: int = 1) -> Survey:
    """What is heard of a station that sends the samples of so many seconds in a message, from `start_s` on.

    A message of it had gone out before.
    """
    survey = site()
    survey.seconds = seconds
    survey.samples.clear()
    samples = message_s * pace
    first = sample(0)[1]
    for number in range(-1, 1 + int((seconds - start_s) // message_s)):
        heard_s = start_s + number * message_s
        times_ns = [NOW_NS + round(heard_s * pace - place) * NS_PER_S for place in range(samples)][::-1]
        message = [first.model_copy(update={"time": time_ns}) for time_ns in times_ns]
        if number < 0:
            survey.gathered["alpha"] = [(NOW_NS, each) for each in message]
        else:
            heard_ns = NOW_NS + round(heard_s * NS_PER_S)
            survey.samples.setdefault("alpha", []).extend((heard_ns, each) for each in message)
    return survey


@pytest.mark.parametrize(
    ("survey", "said"),
    [
        (gathered(30), "30 samples in one message"),
        (gathered(10), "10 samples in one message"),
        (gathered(10, start_s=8.0), "10 samples in its last message"),
        (gathered(60, start_s=50.0), "60 samples in its last message"),
        (gathered(2, start_s=0.5), "1.0 samples a second"),
        (gathered(10, seconds=40.0), "1.0 samples a second"),
        (gathered(1), "0.6 samples a second"),
    ],
)
def test_a_station_that_gathers_its_samples_is_as_well_as_any_other(survey, said):
    findings = list(findings_of(survey, ["alpha"], 60.0))
    assert exit_code(findings) == 0, findings
    (samples,) = [finding for finding in findings if finding.check == "samples"]
    assert said in samples.text
    assert "as fast as life" not in str(findings)


def test_the_pace_of_gathered_samples_is_that_between_two_messages():
    findings = list(findings_of(gathered(10, seconds=40.0, pace=60), ["alpha"], 60.0))
    assert exit_code(findings) == 0
    assert "60.0 samples a second" in str(findings)
    assert "60 times as fast as life" in str(findings)
    wrong = gathered(10)
    wrong.samples["alpha"] = [(heard_ns - 3600 * NS_PER_S, each) for heard_ns, each in wrong.samples["alpha"]]
    (clock,) = [finding for finding in findings_of(wrong, ["alpha"], 60.0) if finding.check == "clock"]
    assert (clock.level, "+3600.0 s from this clock" in clock.text) == ("warning", True)
    assert "--seconds" in clock.advice


def test_a_station_that_has_ceased_to_gather_is_an_error():
    survey = gathered(10, start_s=8.0)
    survey.gathered["alpha"] = [(heard_ns + 3600 * NS_PER_S, each) for heard_ns, each in survey.gathered["alpha"]]
    findings = list(findings_of(survey, ["alpha"], 60.0))
    (told,) = [finding for finding in findings if finding.check == "samples"]
    assert (told.level, told.text) == ("error", "station 'alpha': no sample within 5 s")
    assert "its last message ends 2027-01-15T07:59:58Z" in told.advice


def test_a_survey_takes_the_message_that_was_there_and_those_that_come():
    def block(first: int) -> bytes:
        return SampleBlock.of([sample(number)[1] for number in range(first, first + 10)]).encode()

    async def survey() -> Survey:
        with MemoryBus() as bus:
            publisher = bus.publisher(sample_block_key("alpha"))
            publisher.put(block(0))
            bus.publisher(sample_block_key("beta")).put(b"no block")
            listening = asyncio.create_task(listen(bus, 0.3))
            await asyncio.sleep(0.1)
            publisher.put(block(10))
            return await listening

    heard = asyncio.run(survey())
    assert heard.stations == {"alpha"}
    assert [each.seq for _, each in heard.gathered["alpha"]] == list(range(10))
    assert [each.seq for _, each in heard.samples["alpha"]] == list(range(10, 20))
    assert len({heard_ns for heard_ns, _ in heard.samples["alpha"]}) == 1
