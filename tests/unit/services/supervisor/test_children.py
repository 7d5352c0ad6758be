"""A child of the supervisor has its settings, whatever the environment says."""

import asyncio
import json

from wetwell.services.runtime.settings import load_settings
from wetwell.services.supervisor.children import child


def test_a_flag_of_the_supervisor_beats_a_variable_also_in_its_children(monkeypatch, capfd):
    monkeypatch.setenv("WETWELL_ZENOH__ENDPOINT", "tcp/127.0.0.1:7001")
    monkeypatch.setenv("WETWELL_DASHBOARD__PORT", "8001")
    settings = load_settings(None, {"zenoh": {"endpoint": "tcp/127.0.0.1:7002"}})

    async def show() -> None:
        async with child(settings, "shown", ["config", "show"]) as process:
            assert await process.wait() == 0

    asyncio.run(show())
    shown = json.loads(capfd.readouterr().out)
    assert shown["zenoh"]["endpoint"] == "tcp/127.0.0.1:7002"
    assert shown["dashboard"]["port"] == 8001
