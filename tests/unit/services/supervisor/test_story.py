"""What a run has shown, and how it is told."""

from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.supervisor.screens import TerminalScreen
from wetwell.services.supervisor.story import MOST_CHANGES, Story


def verdict(hour: float, pump: int, state: str, **evidence: object) -> Verdict:
    time_ns = round(hour * 3600 * NS_PER_S)
    onset = None if state in {"learning", "normal"} else time_ns - 600 * NS_PER_S
    return Verdict(
        time=time_ns,
        station="alpha",
        pump=pump,
        state=state,
        probability={state: 0.99},
        evidence=evidence,
        onset=onset,
        window=(time_ns, time_ns),
    )


def test_only_a_change_of_a_known_state_is_one_and_what_is_told_again_is_none() -> None:
    story = Story()
    heard = [verdict(0, 2, "learning"), verdict(6, 2, "normal"), verdict(7, 2, "normal"), verdict(8, 2, "pump_fault")]
    assert [story.handle(each) for each in (*heard, heard[1])] == [False, True, False, True, False]
    assert [each.state for each in story.changes] == ["learning", "normal", "pump_fault"]
    assert story.length_s == 8 * 3600


def test_of_a_long_run_the_last_changes_are_kept() -> None:
    story = Story()
    for hour in range(MOST_CHANGES + 10):
        story.handle(verdict(hour, 1, "normal" if hour % 2 else "pump_fault"))
    assert (len(story.changes), story.passed_over) == (MOST_CHANGES, 10)


def test_the_summary_says_what_when_since_when_and_what_to_do_once() -> None:
    said: list[str] = []
    screen, story = TerminalScreen(lambda text, ends: said.append(text + "\n" * ends), "banner", ["1", "2"]), Story()
    screen.greet()
    screen.show_ready("detector", 1.5)
    for each in (verdict(0, 2, "learning"), verdict(8, 2, "pump_fault", advice="pull the pump")):
        story.handle(each)
        screen.show_verdict(each)
    screen.show_story(story, is_told=True)
    screen.show_story(story, is_told=False)
    text = "".join(said)
    assert "detector 1.5 s\n1970-01-01T00:00:00Z  pump 2  learning" in text, "a line that goes on is ended first"
    summary = text.partition("What was seen in 8.0 h of the station's time:")[2]
    assert "1970-01-01T08:00:00Z  pump 2  PUMP FAULT" in summary
    assert "began about 1970-01-01T07:50:00Z; pull the pump" in summary
    assert text.count("What was seen") == 1


def test_of_a_run_in_which_pumps_only_learnt_there_is_no_summary() -> None:
    said: list[str] = []
    screen, story = TerminalScreen(lambda text, _: said.append(text), "", ["1"]), Story()
    story.handle(verdict(0, 1, "learning"))
    screen.show_story(story, is_told=False)
    assert said == []
