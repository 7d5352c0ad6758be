"""Verdicts older than the last one: told again by a detector that went on from an older state, or of a new time."""

from alarm_site import Site

from wetwell.services.alarms.station_watch import FOLLOW_VERDICTS, START_S


def alarmed(tmp_path) -> Site:
    """A site that has begun anew from its state, with a pump fault that stands; long after its start."""
    site = Site(folder=tmp_path)
    site.wall_s = 3_600.0
    site.sample()
    assert site.verdict("pump_fault", at_s=3_000.0) == [("pump2.pump_fault", "unacknowledged")]
    site.service.save()
    site.start()
    site.wall_s += 2 * START_S
    site.sample()
    return site


def test_a_detector_that_tells_again_what_was_before_a_fault_does_not_end_its_alarm(tmp_path) -> None:
    site = alarmed(tmp_path)
    before = [site.verdict("normal", at_s=100.0 * number) for number in range(10)]
    assert not any(before)
    assert site.verdict("pump_fault", at_s=3_000.0) == []
    assert site.verdict("normal", at_s=3_500.0) == [("pump2.pump_fault", "returned")]


def test_where_the_clock_of_the_station_was_set_back_some_older_verdicts_begin_a_new_time(tmp_path) -> None:
    site = alarmed(tmp_path)
    for second in range(20):
        site.sample(at_s=1_000.0 + second, seq=second)
    told = [site.verdict("normal", at_s=1_100.0 + number) for number in range(FOLLOW_VERDICTS)]
    assert told == [[]] * (FOLLOW_VERDICTS - 1) + [[("pump2.pump_fault", "returned")]]
