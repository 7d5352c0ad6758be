"""Who comes in to the page, who is refused and what it orders is in the audit, and no token is."""

import asyncio
import contextlib
import json
from datetime import timedelta

import httpx
import pytest
from memory_bus import MemoryBus

from wetwell.protocols.bus.keys import plant_clock_key
from wetwell.protocols.messages.plant_clock import PlantClock
from wetwell.services.dashboard.app import AppState, dashboard_app
from wetwell.services.dashboard.event_streams import EventStreams
from wetwell.services.dashboard.view.site_view import SiteView
from wetwell.services.security.audit import audit_in
from wetwell.services.security.audit_chain import broken_lines
from wetwell.services.security.tokens import new_token, revoke_token, today

ADDRESS = "192.0.2.7"


class Site:
    """A page with tokens, and its audit."""

    def __init__(self, folder, bus=None):
        self.file = folder / "tokens.toml"
        self.ada, self.eve = new_token(self.file, "ada", "operator"), new_token(self.file, "eve", "viewer")
        self.audit = audit_in(folder, "dashboard")
        state = AppState(SiteView(10.0), EventStreams(), None, bus)
        self.app = dashboard_app(state, self.file, self.audit, is_local=False)

    def ask(self, *requests):
        """Answers to requests (method, path, token, body) of one browser, one after the other."""

        async def run():
            transport = httpx.ASGITransport(self.app, client=(ADDRESS, 1))
            async with httpx.AsyncClient(transport=transport, base_url="https://site.example") as client:
                return [
                    await client.request(
                        method, path, json=body, headers={"authorization": f"Bearer {token}"} if token else {}
                    )
                    for method, path, token, body in requests
                ]

        return asyncio.run(run())

    def lines(self):
        """What is in the audit, without times and links; no token may be."""
        assert broken_lines(self.audit.path) == []
        text = self.audit.path.read_text()
        assert not any(token.removeprefix("wetwell_") in text for token in (self.ada, self.eve))
        return [
            {name: value for name, value in json.loads(line).items() if name not in {"time", "link"}}
            for line in text.splitlines()
        ]


@pytest.fixture
def site(tmp_path):
    return Site(tmp_path)


def login(token):
    return "POST", "/api/login", "", {"token": token}


def test_a_login_and_a_logout_are_written_down(site):
    site.ask(login(site.ada), ("GET", "/api/alarms", "", None), login(""))
    assert site.lines() == [
        {"act": "login", "by": "ada", "role": "operator", "address": ADDRESS},
        {"act": "logout", "by": "ada", "address": ADDRESS},
    ]


def test_tokens_that_are_wrong_ended_or_revoked_are_told_apart(site):
    old = new_token(site.file, "old", "operator", days=1)
    last = today() + timedelta(days=1)
    site.file.write_text(site.file.read_text().replace(str(last), str(today() - timedelta(days=1))))
    revoke_token(site.file, "eve")
    statuses = [
        answer.status_code
        for answer in site.ask(
            login("nobody's"), ("GET", "/api/alarms", old, None), ("GET", "/api/stations", site.eve, None)
        )
    ]
    assert statuses == [200, 401, 401]
    refused = {"act": "login", "address": ADDRESS, "refused": "wrong token"}
    assert site.lines() == [
        refused | {"path": "/api/login", "token": "unknown"},
        refused | {"path": "/api/alarms", "token": "ended", "name": "old"},
        refused | {"path": "/api/stations", "token": "revoked", "name": "eve"},
    ]


def test_of_a_hundred_wrong_tokens_the_first_ones_are_written_and_that_there_are_too_many(site):
    answers = site.ask(*[("GET", "/api/alarms", f"wrong-{number}", None) for number in range(100)])
    assert [answer.status_code for answer in answers] == [401] * 10 + [429] * 90
    assert [line["refused"] for line in site.lines()] == ["wrong token"] * 10 + ["too many wrong tokens"]
    assert "wrong-" not in site.audit.path.read_text()


def test_an_act_of_a_viewer_is_written_down_as_refused(site):
    (answer,) = site.ask(("POST", "/api/stations/alpha/alarm-act", site.eve, {}))
    assert answer.status_code == 403
    (line,) = site.lines()
    assert (line["by"], line["path"], line["refused"]) == (
        "eve",
        "/api/stations/alpha/alarm-act",
        "may look, not act",
    )


def test_a_disk_that_refuses_keeps_nobody_out_and_is_told(site, caplog):
    site.audit.path.mkdir()
    (answer,) = site.ask(login(site.ada))
    assert answer.json()["name"] == "ada"
    assert site.audit.errors == 1
    assert "dashboard-audit.jsonl: cannot be written: Is a directory; not in the audit" in caplog.text


@contextlib.asynccontextmanager
async def plant(bus, orders):
    """A plant whose clock answers."""
    questions = bus.answer(plant_clock_key("alpha"))

    async def answer():
        while True:
            for request in await questions.receive():
                orders.append(request.payload)
                clock = PlantClock(station="alpha", seconds=1, speed=1.0, full_speed=60.0, is_held=True)
                request.reply(clock.encode())

    task = asyncio.create_task(answer())
    try:
        yield
    finally:
        task.cancel()


def test_an_order_to_the_clock_of_the_plant_is_written_down_before_it_is_sent_or_not_sent(tmp_path):
    bus, orders = MemoryBus(), []
    site = Site(tmp_path, bus)
    path = "/api/stations/alpha/plant-clock"

    async def run():
        headers = {"authorization": f"Bearer {site.ada}"}
        transport = httpx.ASGITransport(site.app, client=(ADDRESS, 1))
        async with (
            plant(bus, orders),
            httpx.AsyncClient(transport=transport, base_url="https://site.example", headers=headers) as client,
        ):
            answers = [await client.post(path, json=order) for order in ({}, {"is_held": True})]
            lines = site.lines()
            site.audit.path.unlink()
            site.audit.path.mkdir()
            return lines, [*answers, await client.post(path, json={"speed": 10.0})]

    lines, answers = asyncio.run(run())
    assert [answer.status_code for answer in answers] == [200, 200, 503]
    assert answers[-1].json() == {"error": "the audit cannot be written, so nothing was done"}
    assert len(orders) == 2
    order = {"by": "ada", "address": ADDRESS, "act": "plant clock", "station": "alpha", "order": {"is_held": True}}
    assert lines == [order]
