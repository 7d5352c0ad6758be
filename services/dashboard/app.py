"""The addresses of the page and what each answers."""

import asyncio
import gzip
import json
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.keys import SITE
from wetwell.services.dashboard.assets import Asset, Assets
from wetwell.services.dashboard.entries import Entries
from wetwell.services.dashboard.event_streams import EventStreams
from wetwell.services.dashboard.guard import Guard
from wetwell.services.dashboard.login import Login, holder_in, while_admitted
from wetwell.services.dashboard.past.client import (
    act_on_alarm,
    enter_act,
    history,
    plant_clock_order,
    recording_pieces,
    set_plant_clock,
)
from wetwell.services.dashboard.past.journal import bands, is_kept, journal
from wetwell.services.dashboard.past.trends import trends_text
from wetwell.services.dashboard.refusal import RefusalError
from wetwell.services.dashboard.reports import find_report, report_names
from wetwell.services.dashboard.view.metrics import StationMetrics
from wetwell.services.dashboard.view.site_view import SiteView
from wetwell.services.security.audit import Audit

GZIP_BYTES = 1000
GZIP_LEVEL = 5


@dataclass
class AppState:
    """What the answers are made from; without a bus nothing can be asked."""

    view: SiteView
    streams: EventStreams
    reports: Path | None = None
    bus: Bus | None = None

    def asked(self) -> Bus:
        """The bus, to ask on.

        Raises
        ------
        RefusalError
            If there is none yet.
        """
        if self.bus is None:
            raise RefusalError(503, "no connection to the bus yet")
        return self.bus

    async def is_known(self, name: str) -> bool | None:
        """Whether a station was heard, or the historian knows it; None while nobody can be asked."""
        station = self.view.stations.get(name)
        if station is not None and station.is_known:
            return True
        return await is_kept(self.bus, name) if self.bus is not None else None


def dashboard_app(
    app_state: AppState, tokens_file: Path | None = None, audit: Audit | None = None, *, is_local: bool = True
) -> Starlette:
    """Web application over a state, behind a `Guard`; without an audit, who comes in and orders is only logged."""
    entries = Entries(audit or Audit(None), tokens_file)
    pages, answers, login = _Pages(app_state), _Answers(app_state, entries), Login(tokens_file, entries)
    shells = ("/", "/alarms", "/reports", "/health")
    return Starlette(
        routes=[
            *(Route(path, pages.shell) for path in shells),
            Route("/station/{station}", pages.station),
            Route("/static/{version}/{name:path}", pages.static),
            Route("/favicon.ico", pages.favicon),
            Route("/events", answers.events),
            Route("/api/stations", answers.stations),
            Route("/api/stations/{station}", answers.station),
            Route("/api/stations/{station}/history", answers.history),
            Route("/api/stations/{station}/trends", answers.trends),
            Route("/api/stations/{station}/bands", answers.bands),
            Route("/api/stations/{station}/recording.csv", answers.recording),
            Route("/api/stations/{station}/episodes", answers.episodes),
            Route("/api/stations/{station}/maintenance", answers.maintenance),
            Route("/api/stations/{station}/maintenance", answers.enter, methods=["POST"]),
            Route("/api/stations/{station}/alarm-act", answers.act, methods=["POST"]),
            Route("/api/stations/{station}/plant-clock", answers.plant_clock, methods=["POST"]),
            Route("/api/who", login.who),
            Route("/api/login", login.enter, methods=["POST"]),
            Route("/api/alarms", answers.alarms),
            Route("/api/alarms/journal", answers.journal),
            Route("/metrics", answers.metrics),
            Route("/api/health", answers.health),
            Route("/api/reports", answers.reports),
            Route("/reports/{name:path}", answers.report),
        ],
        middleware=[Middleware(Guard, tokens_file=tokens_file, entries=entries, is_local=is_local)],
        exception_handlers={RefusalError: _refuse},
    )


class _Pages:
    """The files of the page."""

    def __init__(self, app_state: AppState) -> None:
        self._state = app_state
        self._assets = Assets()

    async def shell(self, request: Request) -> Response:
        return _asset(request, self._assets.shell, "no-cache")

    async def station(self, request: Request) -> Response:
        """The shell, with 404 for a station that nobody knows; its page goes on looking for it."""
        is_known = await self._state.is_known(request.path_params["station"])
        return _asset(request, self._assets.shell, "no-cache", 404 if is_known is False else 200)

    async def static(self, request: Request) -> Response:
        asset = self._assets.files.get(request.path_params["name"])
        if asset is None or request.path_params["version"] != self._assets.version:
            raise RefusalError(404, f"no such file: {request.url.path}")
        return _asset(request, asset, "public, max-age=31536000, immutable")

    async def favicon(self, request: Request) -> Response:
        return _asset(request, self._assets.files["favicon.svg"], "public, max-age=86400")


class _Answers:
    """What is known and what can be asked."""

    def __init__(self, app_state: AppState, entries: Entries) -> None:
        self._state = app_state
        self._entries = entries
        self._registry = CollectorRegistry()
        self._registry.register(StationMetrics(app_state.view))

    async def events(self, request: Request) -> Response:
        return StreamingResponse(
            while_admitted(request, self._state.streams.listen(request.query_params.get("station", ""))),
            media_type="text/event-stream",
            headers={"cache-control": "no-store", "x-accel-buffering": "no"},
        )

    async def stations(self, request: Request) -> Response:
        return _json(request, self._state.view.site_state())

    async def station(self, request: Request) -> Response:
        name = request.path_params["station"]
        text = self._state.view.station_state(name)
        if text is None:
            if not await self._state.is_known(name):
                raise RefusalError(404, f"there is no station '{name}'")
            text = self._state.view.empty_state(name)
        return _json(request, text)

    async def trends(self, request: Request) -> Response:
        asked = dict(request.query_params) | {"kind": "samples"}
        answer = await history(self._state.asked(), request.path_params["station"], asked)
        if answer.error:
            raise RefusalError(502, answer.error)
        return _json(request, trends_text(answer))

    async def bands(self, request: Request) -> Response:
        found = await bands(self._state.asked(), request.path_params["station"], request.query_params)
        return _json(request, json.dumps(found))

    async def journal(self, request: Request) -> Response:
        query = dict(request.query_params)
        station = query.pop("station", "")
        stations = [station] if station else [*self._state.view.stations, SITE]
        return _json(request, json.dumps(await journal(self._state.asked(), stations, query)))

    async def metrics(self, request: Request) -> Response:  # noqa: ARG002 - a handler takes its request
        text = await asyncio.to_thread(generate_latest, self._registry)
        return Response(text, media_type=CONTENT_TYPE_PLAIN_0_0_4, headers={"cache-control": "no-store"})

    async def alarms(self, request: Request) -> Response:
        return _json(request, self._state.view.alarms())

    async def health(self, request: Request) -> Response:
        bus = self._state.bus
        services = self._state.view.health(asyncio.get_running_loop().time())
        return _json(request, json.dumps({"connected": bus is not None and bus.is_connected, "services": services}))

    async def act(self, request: Request) -> Response:
        holder = holder_in(request)
        by = None if holder is None else holder.name
        answer = await act_on_alarm(self._state.asked(), request.path_params["station"], await request.body(), by)
        return JSONResponse(answer)

    async def plant_clock(self, request: Request) -> Response:
        bus, station = self._state.asked(), request.path_params["station"]
        order = plant_clock_order(await request.body())
        changes = order.model_dump(exclude={"schema_name"}, exclude_defaults=True)
        if changes:
            await self._entries.order(
                holder_in(request), request.scope, act="plant clock", station=station, order=changes
            )
        return JSONResponse(await set_plant_clock(bus, station, order))

    async def history(self, request: Request) -> Response:
        answer = await history(self._state.asked(), request.path_params["station"], request.query_params)
        return _json(request, answer.encode().decode())

    async def episodes(self, request: Request) -> Response:
        return await self._messages(request, "episodes")

    async def maintenance(self, request: Request) -> Response:
        return await self._messages(request, "maintenance")

    async def _messages(self, request: Request, kind: str) -> Response:
        """What the historian keeps of a kind, by `from` and `to` where they are given, as a list under its name."""
        names = {"from": "start", "to": "end", "points": "points"}
        query = {names[name]: value for name, value in request.query_params.items() if name in names}
        answer = await history(self._state.asked(), request.path_params["station"], query, kind=kind)
        told = {"station": answer.station, kind: answer.messages} | ({"error": answer.error} if answer.error else {})
        return _json(request, json.dumps(told))

    async def enter(self, request: Request) -> Response:
        holder = holder_in(request)
        by = None if holder is None else holder.name
        answer = await enter_act(self._state.asked(), request.path_params["station"], await request.body(), by)
        return JSONResponse(answer)

    async def recording(self, request: Request) -> Response:
        name = request.path_params["station"]
        pieces = recording_pieces(self._state.asked(), name, request.query_params)
        first = await anext(pieces)  # what is wrong is told before the file begins

        async def content() -> AsyncIterator[str]:
            yield first
            async for piece in pieces:
                yield piece

        headers = {"content-disposition": f'attachment; filename="{name}.csv"', "cache-control": "no-store"}
        return StreamingResponse(content(), media_type="text/csv; charset=utf-8", headers=headers)

    async def reports(self, request: Request) -> Response:
        return _json(request, json.dumps(report_names(self._state.reports)))

    async def report(self, request: Request) -> Response:
        path = find_report(self._state.reports, request.path_params["name"])
        content = await asyncio.to_thread(path.read_bytes)
        return Response(content, media_type="text/html; charset=utf-8", headers={"cache-control": "no-cache"})


async def _refuse(_: Request, error: Exception) -> Response:
    return JSONResponse({"error": str(error)}, error.status if isinstance(error, RefusalError) else 500)


def _asset(request: Request, asset: Asset, caching: str, status: int = 200) -> Response:
    headers = {"etag": asset.etag, "cache-control": caching, "vary": "accept-encoding"}
    if status == 200 and request.headers.get("if-none-match") == asset.etag:
        return Response(status_code=304, headers=headers)
    content = asset.content
    if _takes_gzip(request):
        content, headers = asset.compressed, headers | {"content-encoding": "gzip"}
    return Response(content, status, media_type=asset.media_type, headers=headers)


def _json(request: Request, text: str) -> Response:
    content, headers = text.encode(), {"cache-control": "no-store"}
    if len(content) > GZIP_BYTES and _takes_gzip(request):
        content = gzip.compress(content, GZIP_LEVEL, mtime=0)
        headers |= {"content-encoding": "gzip", "vary": "accept-encoding"}
    return Response(content, media_type="application/json", headers=headers)


def _takes_gzip(request: Request) -> bool:
    return "gzip" in request.headers.get("accept-encoding", "")
