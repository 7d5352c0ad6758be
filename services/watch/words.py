"""The watch of a station as others see it: a message, and lines for a terminal."""

from collections.abc import Mapping

from wetwell.protocols.messages.gap_watch import GapLook, GapName, GapWatch
from wetwell.protocols.timestamps import to_iso
from wetwell.services.reports.tables import as_lines
from wetwell.sim2real.diagnosis.report import FoundEffect
from wetwell.sim2real.watch.state import Called, KeptLook, WatchState

TOLD_LOOKS = 90
"""Looks that a message has: a quarter of a year, one a day."""
TOLD_PAST = 10


def message_of(state: WatchState) -> GapWatch | None:
    """What is told of a station; None before its first look."""
    if not state.looks:
        return None
    last = state.looks[-1]
    return GapWatch(
        time=last.end_ns,
        station=state.station.name,
        gap=last.gap,
        matters=last.matters,
        interval=last.interval,
        group=last.group,
        first_matters=state.first_matters,
        is_doubled=state.is_doubled,
        called=tuple(_name(one) for one in state.called),
        past=tuple(_name(one.called, one.ended_ns) for one in state.past[-TOLD_PAST:]),
        looks=tuple(_look(look) for look in state.looks[-TOLD_LOOKS:]),
        refused=state.refused,
    )


def watch_lines(watches: list[GapWatch], labels: Mapping[str, str]) -> str:
    """A table of stations, by key and what people call them (`labels`), and below it what their gaps are called."""
    stations = [
        {
            "station": labels[one.station],
            "until": to_iso(one.time)[:16],
            "gap": round(max(one.gap.values(), default=1.0), 2),
            "matters": round(one.matters, 2),
            "at first": round(one.first_matters, 2),
            "at": one.group,
            "doubled": "yes" if one.is_doubled else "",
        }
        for one in watches
    ]
    names = [
        {"station": labels[one.station], "called": each.text} for one in watches for each in (*one.called, *one.past)
    ] or "none"
    return as_lines({"stations": stations or "none", "names": names})


def effect_words(effect: FoundEffect) -> str:
    """An effect with its sizes.

    Examples
    --------
    >>> from wetwell.sim2real.diagnosis.report import FittedParameter
    >>> factor = FittedParameter(value=1.1, ci=(1.09, 1.11), unit="1")
    >>> effect_words(FoundEffect(name="friction_bias", component="rising_main", equivalent=(),
    ...                          parameters={"factor": factor}))
    'friction bias, factor 1.1 (1.09 to 1.11)'
    """
    words = [effect.name.replace("_", " ")]
    for name, one in effect.parameters.items():
        unit = "" if one.unit in {"", "1"} else f" {one.unit}"
        value = one.value if isinstance(one.value, str) else format(one.value, ".3g")
        interval = "" if one.ci is None else f" ({one.ci[0]:.3g} to {one.ci[1]:.3g})"
        words.append(f"{name.replace('_', ' ')} {value}{unit}{interval}")
    return ", ".join(words)


def _name(one: Called, ended_ns: int | None = None) -> GapName:
    what = "something that no effect explains" if one.effect is None else effect_words(one.effect)
    others = () if one.effect is None else one.effect.equivalent
    what += f", or as well {' or '.join(others)}".replace("_", " ") if others else ""
    since = "from the first look on" if one.since_ns is None else f"since {to_iso(one.since_ns)[:16]}"
    until = "" if ended_ns is None else f", over since {to_iso(ended_ns)[:16]}"
    told = "" if one.fault is None else f"; the detector tells it as a fault of {one.fault}"
    return GapName(
        effect=None if one.effect is None else one.effect.model_dump(mode="json"),
        component=one.component,
        probability=one.probability,
        since=one.since_ns,
        ended=ended_ns,
        fault=one.fault,
        text=f"{one.component.replace('_', ' ')}: {what}, {since}{until}{told}"[:1000],
    )


def _look(look: KeptLook) -> GapLook:
    return GapLook(time=look.end_ns, gap=look.gap, matters=look.matters, interval=look.interval)
