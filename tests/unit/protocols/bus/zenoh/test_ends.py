"""Publishers say which message was their last when it is time to, on a virtual clock."""

from dataclasses import dataclass, field

from wetwell.protocols.bus.zenoh.ends import END_SLOT_S, TOLD_AT_ONCE, Ends
from wetwell.protocols.bus.zenoh.publisher import end_due_s

LOOK_S = 0.02


@dataclass
class Speaker:
    """A publisher that is silent since a time."""

    silent_s: float = 0.0
    rests_until_s: float = 0.0
    told_s: list[float] = field(default_factory=list)
    looks: int = 0

    def settle(self, now_s: float) -> bool:
        self.looks += 1
        is_due = end_due_s(self.silent_s, max(self.told_s, default=0.0)) <= now_s
        if is_due:
            self.told_s.append(now_s)
        self.rests_until_s = end_due_s(self.silent_s, max(self.told_s, default=0.0))
        return is_due


def went_on(ends, begin_s, seconds):
    for number in range(round(seconds / LOOK_S)):
        ends.settle(begin_s + number * LOOK_S)


def test_a_silent_publisher_says_its_end_when_it_should():
    ends, speaker = Ends(), Speaker(silent_s=100.0, rests_until_s=101.0)
    ends.spoken.append(speaker)
    went_on(ends, 100.0, 200.0)
    for told_s, due_s in zip(speaker.told_s, (101.0, 104.0, 116.0, 164.0, 224.0, 284.0), strict=True):
        assert due_s <= told_s <= due_s + 5 * END_SLOT_S


def test_who_speaks_again_and_again_is_hardly_looked_at():
    ends, speaker = Ends(), Speaker()
    ends.spoken.append(speaker)
    for second in range(100):
        speaker.silent_s, speaker.rests_until_s = float(second), second + 2.0
        went_on(ends, float(second), 1.0)
    assert speaker.told_s == []
    assert speaker.looks == 0


def test_no_look_tells_the_ends_of_more_than_a_few_publishers_and_none_is_forgotten():
    ends = Ends()
    speakers = [Speaker(silent_s=0.0, rests_until_s=1.0) for _ in range(1_000)]
    ends.spoken.extend(speakers)
    for number in range(1_000 // TOLD_AT_ONCE):
        ends.settle(1.5)
        assert sum(len(speaker.told_s) for speaker in speakers) == (number + 1) * TOLD_AT_ONCE
        assert sum(speaker.looks for speaker in speakers) == (number + 1) * TOLD_AT_ONCE
    assert all(len(speaker.told_s) == 1 for speaker in speakers)


def test_where_a_link_was_away_all_are_looked_at_at_once():
    ends = Ends()
    speakers = [Speaker(rests_until_s=1_000.0) for _ in range(5)]
    ends.spoken.extend(speakers)
    ends.settle(1.5)
    assert not any(speaker.told_s for speaker in speakers)
    for speaker in speakers:
        speaker.rests_until_s = 0.0
    ends.look_at_all()
    ends.settle(1.6)
    assert all(speaker.told_s == [1.6] for speaker in speakers)
