"""The alarm of a gap that has doubled: advisory, told with its name, gone with the gap, kept over a restart."""

from alarm_site import START_NS, Site

from wetwell.protocols.messages.gap_watch import GapName, GapWatch
from wetwell.protocols.timestamps import NS_PER_DAY

FRICTION = GapName(component="rising_main", probability=0.98, since=START_NS, text="rising main: friction bias")


class Watched(Site):
    """A site whose watch tells gaps."""

    def gap(self, day, *, is_doubled, called=(FRICTION,)):
        gap = GapWatch(
            time=START_NS + day * NS_PER_DAY,
            station="alpha",
            gap={"flow": 4.0},
            matters=3.3,
            interval=(3.1, 3.5),
            group="flow/1/steady",
            first_matters=0.1,
            is_doubled=is_doubled,
            called=called,
        )
        self.service.handle_gap(gap.encode())
        return self.news()


def test_a_gap_that_has_doubled_is_told_and_calls_nobody():
    site = Watched()
    assert site.gap(1, is_doubled=False) == []
    assert site.gap(2, is_doubled=True) == [("model_gap", "acknowledged")]
    (alarm,) = site.told
    assert (alarm.priority, alarm.raised) == ("advisory", START_NS + 2 * NS_PER_DAY)
    assert "0.1 at first and is 3.3" in alarm.text
    assert "friction bias" in alarm.text
    assert len(site.service.registry.rates.calls_ns) == 0
    assert site.gap(3, is_doubled=True) == []
    assert site.gap(4, is_doubled=False) == [("model_gap", "normal")]


def test_what_the_detector_tells_is_not_named_again():
    site = Watched()
    fault = FRICTION.model_copy(update={"fault": "main"})
    site.gap(2, is_doubled=True, called=(fault,))
    assert "friction" not in site.told[0].text
    assert "not named yet" in site.told[0].text


def test_it_is_no_news_after_a_restart(tmp_path):
    site = Watched(tmp_path)
    site.gap(2, is_doubled=True)
    site.start()
    assert site.gap(2, is_doubled=True) == []


def test_a_crew_at_the_station_is_no_gap():
    site = Watched()
    site.sample()
    assert site.act("maintenance", alarm="station", reason="new pump").is_done
    site.news()
    assert site.gap(2, is_doubled=True) == [("model_gap", "suppressed")]


def test_what_is_no_gap_is_counted():
    site = Watched()
    site.service.handle_gap(b'{"station": "alpha"}')
    assert site.service.figures()["malformed"] == 1.0
