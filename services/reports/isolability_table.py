"""What can be told apart, as tables for the terminal, programs and the documentation."""

from collections.abc import Iterator, Sequence
from itertools import combinations

from wetwell.protocols.quantities import SIGNALS
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.isolability.isolability import Isolability, Telling, isolability

TOLD, NOT_VISIBLE = "✓", "·"
_WORDS = {quantity: word for word, quantity in SIGNALS.items()}


def isolability_table(station: Station, told: Isolability, *, as_json: bool) -> dict[str, object]:
    """What can be told apart, by cause; `seen` in units of noise at the size from which somebody would act.

    Parameters
    ----------
    station : Station
    told : Isolability
    as_json : bool
        Lists for programs, in place of text for people.
    """

    def listed(names: Sequence[str]) -> object:
        return list(names) if as_json else ", ".join(names) or "-"

    def row(cause: Telling) -> dict[str, object]:
        seen_as = "not told apart" if cause.same_as else "told"
        return {
            "name": cause.name,
            "component": cause.component,
            "seen": round(cause.size, 1),
            "verdict": seen_as if cause.is_visible else "not visible",
            "same_as": listed(cause.same_as),
        }

    return {
        "station": station.name,
        "signals": listed(["frequency", *(_WORDS[quantity] for quantity in told.signals)]),
        "duty_points": told.points,
        "effects_at_once": told.ranks.get("effect", 0),
        "faults_at_once": told.ranks.get("fault", 0),
        "effects": [row(cause) for cause in told.causes if cause.kind == "effect"],
        "faults": [row(cause) for cause in told.causes if cause.kind == "fault"],
    }


def signals_markdown(station: Station) -> str:
    """A table in Markdown: effects in the columns, every combination of signals in the rows.

    A cell is `TOLD`, `NOT_VISIBLE`, or the letter of the group within which it is not told apart.
    """
    rows = [(words, isolability(station, [SIGNALS[word] for word in words])) for words in _combinations()]
    names = [cause.name for cause in rows[0][1].causes if cause.kind == "effect"]
    lines = [f"| signals | {' | '.join(f'`{name}`' for name in names)} |", "|---" * (len(names) + 1) + "|"]
    for words, told in rows:
        lines.append(f"| {', '.join(words)} | {' | '.join(_cells(told))} |")
    return "\n".join(lines)


def _combinations() -> Iterator[tuple[str, ...]]:
    for size in range(1, len(SIGNALS) + 1):
        yield from combinations(SIGNALS, size)


def _cells(told: Isolability) -> list[str]:
    letters: dict[str, str] = {}
    effects = [cause for cause in told.causes if cause.kind == "effect"]
    groups = [group for group in told.groups if any(cause.name in group for cause in effects)]
    for letter, group in zip("abcdefghijk", groups, strict=False):
        letters |= dict.fromkeys(group, letter)
    return [letters.get(cause.name, TOLD if cause.is_visible else NOT_VISIBLE) for cause in effects]
