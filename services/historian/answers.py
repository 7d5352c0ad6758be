"""Answers to the questions of `HistoryQuery`, from any store."""

import json
from collections.abc import Mapping
from typing import Any

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.bus.keys import SITE
from wetwell.protocols.messages.history import History, HistoryQuery, Kind
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.timestamps import to_iso
from wetwell.services.historian.changes import changes_of
from wetwell.services.historian.episodes import episodes_between
from wetwell.services.historian.hours import Hours, joined_hours
from wetwell.services.historian.rows import HOUR_NS
from wetwell.services.historian.samples import Samples, merged
from wetwell.services.historian.store.interface import DAY_NS, StationSpan, Store, StoreError, blocks, day_of
from wetwell.services.historian.summary import TEN_NS


def answer(store: Store, station: str, payload: bytes) -> History:
    """Answer to a question about a station; what is wrong with it, or with the store, is said in it."""
    try:
        query = HistoryQuery.decode(payload)
    except MessageError as error:
        return History(station=station, kind="samples", error=str(error))
    try:
        return _answer(store, station, query)
    except StoreError as error:
        return History(station=station, kind=query.kind, error=str(error))


def _answer(store: Store, station: str, query: HistoryQuery) -> History:
    if query.kind == "stations" and station == SITE:
        return History(
            station=SITE, kind="stations", messages=tuple(_of_station(store, each) for each in store.stations())
        )
    span = store.station(station)
    if span is None:
        return History(station=station, kind=query.kind, error=f"station '{station}' is not known")
    if query.kind == "stations":
        return History(station=station, kind="stations", messages=(_of_station(store, span),))
    if query.kind in ("samples", "kpi"):
        return _of_span(store, span, query)
    return History(station=station, kind=query.kind, messages=_messages(store, station, query))


def _messages(store: Store, station: str, query: HistoryQuery) -> tuple[dict[str, Any], ...]:
    """Messages of a kind, oldest first."""
    if query.kind == "changes":
        return changes_of(store, station, query.start, query.end, query.points)
    if query.kind in ("verdicts", "alarms", "maintenance"):
        messages = [
            json.loads(each) for each in store.events(query.kind, station, query.start, query.end, query.points)
        ]
        if query.kind == "maintenance":  # of each act the last that was told of it
            messages = list({message["id"]: message for message in messages}.values())
        return tuple(messages)
    found = episodes_between(store, station, query.start, query.end)[-query.points :]
    return tuple(one.model_dump(mode="json") for one in found)


def _of_span(store: Store, span: StationSpan, query: HistoryQuery) -> History:
    """Columns of the part of a span that was kept."""
    start_ns, end_ns = max(query.start, span.first_ns), min(query.end, span.last_ns + 1)
    if start_ns >= end_ns:
        return History(station=span.station, kind=query.kind)
    of_kind = _of_kpi if query.kind == "kpi" else _of_raw if query.raw else _of_samples
    return of_kind(store, span.station, start_ns, end_ns, query.points)


def _of_station(store: Store, span: StationSpan) -> dict[str, str | None]:
    has_samples = span.last_ns >= span.first_ns
    newest_ns = store.newest_ns(span.station)
    return {
        "station": span.station,
        "first": to_iso(span.first_ns) if has_samples else None,
        "last": to_iso(span.last_ns if newest_ns is None else newest_ns) if has_samples else None,
    }


def _of_samples(store: Store, station: str, start_ns: int, end_ns: int, points: int) -> History:
    if store.is_few(station, start_ns, end_ns, points):
        samples = merged(list(blocks(store, station, start_ns, end_ns)))
        return _columns(station, "samples", samples.time_ns, _by_name(samples))
    summary = store.summary(station, *spans_of(start_ns, end_ns, points))
    return _columns(station, "samples", summary.time_ns, summary.columns())


def spans_of(start_ns: int, end_ns: int, points: int) -> tuple[int, int, int]:
    """Start, end and length of at most so many equal spans; from an hour on all three are whole tens of minutes.

    Examples
    --------
    >>> [value / TEN_NS for value in spans_of(TEN_NS // 2, 60 * TEN_NS + 1, 7)]
    [1.0, 61.0, 9.0]
    """
    span_ns = -(-(end_ns - start_ns) // points)
    if span_ns < HOUR_NS:
        return start_ns, end_ns, span_ns
    start_ns, end_ns = (-(-each_ns // TEN_NS) * TEN_NS for each_ns in (start_ns, end_ns))
    return start_ns, end_ns, -(-(end_ns - start_ns) // (points * TEN_NS)) * TEN_NS


def _of_raw(store: Store, station: str, start_ns: int, end_ns: int, points: int) -> History:
    found: list[Samples] = []
    for block in blocks(store, station, start_ns, end_ns):
        found.append(block)
        if sum(map(len, found)) > points:
            break
    every = merged(found)
    samples = every.select(slice(0, points))
    columns = {"seq": samples.seq.astype(float), "quality": samples.quality.astype(float)} | _by_name(samples)
    history = _columns(station, "samples", samples.time_ns, columns)
    return history.model_copy(update={"more": len(every) > points})


def _of_kpi(store: Store, station: str, start_ns: int, end_ns: int, points: int) -> History:
    """Hours that begin in the span, or if they are too many the days that they belong to."""
    start_ns = -(-start_ns // HOUR_NS) * HOUR_NS if start_ns % HOUR_NS else start_ns
    hours = hours_of(store, station, start_ns, end_ns)
    if len(hours) > points:
        hours = hours.over(DAY_NS)
    columns = {name: column[-points:] for name, column in hours.columns().items()}
    return _columns(station, "kpi", hours.hour_ns[-points:], columns)


def hours_of(store: Store, station: str, start_ns: int, end_ns: int) -> Hours:
    """Figures of the hours that begin in a span: those that are kept, and of the other days from the samples."""
    hours = store.hours(station, start_ns, end_ns)
    kept_ns = {day_of(hour_ns) for hour_ns in hours.hour_ns.tolist()}
    for day_ns in store.days_ns(station, start_ns, end_ns):
        if day_ns not in kept_ns:
            around = store.samples(station, day_ns - HOUR_NS, day_ns + DAY_NS + HOUR_NS)
            first_ns, last_ns = max(day_ns, start_ns), min(day_ns + DAY_NS, end_ns)
            hours = joined_hours(hours, Hours.of_samples(around, first_ns, last_ns))
    return hours


def _by_name(samples: Samples) -> dict[str, Floats]:
    return dict(zip(samples.columns, samples.values.T, strict=True))


def _columns(station: str, kind: Kind, time_ns: Integers, columns: Mapping[str, Floats]) -> History:
    lists = {name: tuple(column.tolist()) for name, column in columns.items()}
    return History.model_construct(station=station, kind=kind, time=tuple(time_ns.tolist()), columns=lists)
