"""Stations and scenarios by name or by file.

A file that is wrong is told at once: the compiled plant, whose import takes longer, is loaded for one that is right.
"""

from collections.abc import Iterable
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.station.station_file import Station, load_station, load_toml

if TYPE_CHECKING:
    from wetwell.simulator.scenario import Scenario

_PLANT = files("wetwell.simulator")


def find_station(name_or_path: str) -> Station:
    """Station that comes with the package under this name, or in this file.

    Raises
    ------
    ConfigError
        If there is none, its file breaks a rule, one of its effects does, or it cannot be operated.
    """
    with as_file(_PLANT / "stations") as folder:
        path = _find(name_or_path, folder, "station")
        station = load_station(path)
    from wetwell.simulator.duty import check_operable
    from wetwell.simulator.effects import effective_parameters

    try:
        check_operable(station.name, effective_parameters(station))
    except ValueError as error:
        raise ConfigError(f"{path}: {error}") from error
    return station


def find_stations(names_or_paths: Iterable[str]) -> list[Station]:
    """Stations as `find_station` finds them; of a folder, those of all its TOML files.

    Raises
    ------
    ConfigError
        If one is wrong, a folder holds none, or two have the same name.
    """
    stations: dict[str, Station] = {}
    for name_or_path in names_or_paths:
        folder = Path(name_or_path)
        paths = [str(path) for path in sorted(folder.glob("*.toml"))] if folder.is_dir() else [name_or_path]
        if not paths:
            raise ConfigError(f"{folder}: must hold a station file (*.toml)")
        for file in paths:
            station = find_station(file)
            if station.name in stations:
                raise ConfigError(f"{file}: station '{station.name}' is given twice")
            stations[station.name] = station
    return list(stations.values())


def find_scenario(name_or_path: str) -> "Scenario":
    """Scenario that comes with the package under this name, or in this file.

    Raises
    ------
    ConfigError
        If there is none, or its file breaks a rule.
    """
    with as_file(_PLANT / "scenarios") as folder:
        path = _find(name_or_path, folder, "scenario")
        table = load_toml(path)
    from wetwell.simulator.scenario import Scenario

    _read_inflow(table, path)
    try:
        return Scenario.model_validate(table)
    except ValidationError as error:
        raise ConfigError(f"{path}: {first_fault(error)}") from error


def _find(name_or_path: str, folder: Path, kind: str) -> Path:
    preset = folder / f"{name_or_path}.toml"
    if "/" not in name_or_path and preset.is_file():
        return preset
    path = Path(name_or_path)
    if path.is_file() or path.suffix:
        return path
    names = ", ".join(sorted(preset.stem for preset in folder.glob("*.toml")))
    raise ConfigError(f"{kind} '{name_or_path}' is neither a file nor one of {names}")


def _read_inflow(table: dict[str, Any], path: Path) -> None:
    """Put the series of a recording in the place of its file's name: `inflow = {kind = "recorded", file = "..."}`."""
    inflow = table.get("inflow")
    if not isinstance(inflow, dict) or inflow.get("kind") != "recorded" or "file" not in inflow:
        return
    import numpy as np

    from wetwell.protocols.recordings.recording import read_recording
    from wetwell.protocols.timestamps import NS_PER_S

    source = path.parent / str(inflow.pop("file"))
    recording = read_recording(source)
    flow_m3h = recording.column("inflow_m3h")
    known = np.flatnonzero(np.isfinite(flow_m3h))
    if known.size == 0:
        raise ConfigError(f"{path}: inflow.file: '{source}' has no values in column 'inflow_m3h'")
    order = known[np.unique(recording.time_ns[known], return_index=True)[1]]
    inflow["time_s"] = (recording.time_ns[order] - recording.time_ns[order[0]]) / NS_PER_S
    inflow["flow_m3h"] = np.maximum(flow_m3h[order], 0.0)
