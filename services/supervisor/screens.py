"""Where `wetwell up` says what happens: lines for people, or every verdict as JSON."""

from collections.abc import Callable, Sequence

from wetwell.protocols.messages.plant_clock import PlantClock
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.reports.terminal import StateLines, begin_line, clock_line, story_lines
from wetwell.services.supervisor.story import Story


class TerminalScreen:
    """Lines for people.

    Parameters
    ----------
    say : callable
        Prints a text, with a line break behind it or without.
    banner : str
        Where to look.
    names : sequence of str
        What people call the pumps.
    """

    def __init__(self, say: Callable[[str, bool], None], banner: str, names: Sequence[str]) -> None:
        self._say = say
        self._banner = banner
        self._names = names
        self._lines = StateLines(names)
        self._is_told = False
        self._is_open = False

    def greet(self) -> None:
        """Say where to look."""
        self._end(self._banner)
        self._go_on("Starting; the first time kernels are compiled, which takes half a minute:\n")

    def show_ready(self, part: str, after_s: float) -> None:
        """Go on with the line of the parts that are ready."""
        self._go_on(f" {part} {after_s:.1f} s")

    def show_begin(self, *, has_keys: bool) -> None:
        """Say that the plant begins."""
        self._end(begin_line(has_keys=has_keys))

    def show_verdict(self, verdict: Verdict) -> None:
        """Say what is new."""
        line = self._lines.line(verdict)
        if line is not None:
            self._end(line)

    def show_clock(self, clock: PlantClock) -> None:
        """Say how the clock stands."""
        self._end(clock_line(clock))

    def show_story(self, story: Story, *, is_told: bool) -> None:
        """Say what was seen, once."""
        if story.has_judged and not self._is_told:
            self._end("\n" + story_lines(story.changes, story.length_s / 3600.0, self._names))
        if is_told:
            self._is_told = True
            self._end("\nThe story is told, and the plant stands; the page goes on. Ctrl-C ends.")

    def _go_on(self, text: str) -> None:
        self._is_open = True
        self._say(text, False)

    def _end(self, text: str) -> None:
        self._say("\n" + text if self._is_open else text, True)
        self._is_open = False


class JsonScreen:
    """Every verdict as a line of JSON, and nothing else.

    Parameters
    ----------
    say : callable
        As of `TerminalScreen`.
    """

    def __init__(self, say: Callable[[str, bool], None]) -> None:
        self._say = say

    def greet(self) -> None:
        """Say nothing."""

    def show_ready(self, part: str, after_s: float) -> None:
        """Say nothing."""

    def show_begin(self, *, has_keys: bool) -> None:
        """Say nothing."""

    def show_verdict(self, verdict: Verdict) -> None:
        """Say it."""
        self._say(verdict.encode().decode(), True)

    def show_clock(self, clock: PlantClock) -> None:
        """Say nothing."""

    def show_story(self, story: Story, *, is_told: bool) -> None:
        """Say nothing."""
