"""Questions to a running historian over the bus."""

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.keys import SITE, history_key
from wetwell.protocols.errors import ConfigError
from wetwell.protocols.messages.history import History, HistoryQuery, Kind
from wetwell.protocols.timestamps import NS_PER_S, from_iso
from wetwell.services.runtime.client import ask_service, first_answer
from wetwell.services.runtime.settings import Settings

HISTORY_ANSWER_S = 20.0


async def ask_history(
    settings: Settings,
    station: str,
    kind: Kind,
    *,
    last_s: float | None,
    span: tuple[int, int],
    points: int,
    raw: bool,
) -> History:
    """Answer of the historian over Zenoh; with `last_s` the time up to the newest sample of the station.

    Raises
    ------
    LinkError
        If none answers within `HISTORY_ANSWER_S`.
    ConfigError
        If it answers with an error.
    """

    async def question(bus: Bus) -> History:
        start_ns, end_ns = span
        if last_s is not None:
            end_ns = (await _newest_ns(bus, station) // NS_PER_S + 1) * NS_PER_S
            start_ns = end_ns - round(last_s * NS_PER_S)
        return await asked(bus, station, HistoryQuery(kind=kind, start=start_ns, end=end_ns, points=points, raw=raw))

    return await ask_service(settings, question, "no historian", HISTORY_ANSWER_S)


async def asked(bus: Bus, station: str, query: HistoryQuery) -> History:
    """Answer of the historian on a bus; asks again until there is one.

    Raises
    ------
    ConfigError
        If it answers with an error.
    """
    history = History.decode(
        await first_answer(bus, history_key(station), query.encode(), timeout_s=HISTORY_ANSWER_S)
    )
    if history.error:
        raise ConfigError(history.error)
    return history


async def _newest_ns(bus: Bus, station: str) -> int:
    stations = await asked(bus, SITE, HistoryQuery(kind="stations"))
    for message in stations.messages:
        if message["station"] == station and message["last"] is not None:
            return from_iso(message["last"])
    raise ConfigError(f"station '{station}': no samples are kept")
