"""The TOML that pages show is what wetwell takes: as a file, or as a part of one."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel, ValidationError

from wetwell.protocols.bus.roles import AccessTable
from wetwell.protocols.modbus.device_map import DeviceFile
from wetwell.protocols.recordings.importers.mapping import TagMapping
from wetwell.protocols.station.station_file import Station
from wetwell.services.runtime.settings import Settings
from wetwell.sim2real.recording.preparation import Preparation
from wetwell.simulator.effects import effective_parameters
from wetwell.simulator.scenario import Scenario

ROOT = Path(__file__).parents[2]
STATION = {"name": "north", "sump": {"area_m2": 8.0}, "pump": [{"curve": [36.0, -0.02333, -1.3333e-4]}] * 2}
MODELS: tuple[tuple[type[BaseModel], dict[str, Any]], ...] = (
    (Settings, {}),
    (Station, STATION),
    (Scenario, {"name": "fault", "duration_s": 86400.0}),
    (TagMapping, {"station": "north", "layout": "wide", "columns": {"time": "time"}}),
    (Preparation, {}),
    (DeviceFile, {}),
    (AccessTable, {}),
)
"""Models of files, each with what a page may leave out where it shows a part."""


def shown() -> Iterator[tuple[str, str]]:
    """Page and text of each block of TOML."""
    for page in sorted((ROOT / "docs").glob("*.md")):
        name = page.relative_to(ROOT).as_posix()
        for block in re.findall(
            r"^ *```toml\n(.*?)^ *```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
        ):
            yield name, block


def takes(model: type[BaseModel], values: dict[str, Any]) -> bool:
    """Whether a model takes the values, and the library the effects in them."""
    try:
        read = model.model_validate(values)
    except ValidationError:
        return False
    if isinstance(read, Station):
        effective_parameters(read)
    return True


@pytest.mark.parametrize(("page", "text"), list(shown()))
def test_a_file_that_a_page_shows_is_taken(page: str, text: str) -> None:
    values = tomllib.loads(text)
    assert any(takes(model, left_out | values) for model, left_out in MODELS), page
