"""Exports of other systems turned into recordings, and what is told of it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import ConfigError
from wetwell.protocols.quantities import pump_of
from wetwell.protocols.recordings.importers.conversion import Conversion, convert
from wetwell.protocols.recordings.importers.draft.draft import draft_of
from wetwell.protocols.recordings.importers.mapping import TagMapping, load_mapping
from wetwell.protocols.recordings.importers.signals.main_flow import HandedOut
from wetwell.protocols.recordings.recording import write_recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S, to_iso


def convert_files(
    paths: Sequence[Path], mapping_path: Path, out: Path, station: Station | None = None
) -> dict[str, object]:
    """Write the recording that a mapping makes of an export; what was assumed, left out and made.

    Parameters
    ----------
    paths : sequence of Path
        Files of the export; together they are one recording.
    mapping_path : Path
    out : Path
    station : Station, optional
        For drives in percent of the nominal frequency.

    Raises
    ------
    ConfigError
        If the mapping breaks a rule or does not fit the files, or the station.
    RecordingError
        If a file cannot be read, or the recording cannot be written.
    """
    mapping = load_mapping(mapping_path)
    if station is not None and station.name != mapping.station:
        raise ConfigError(
            f"{mapping_path}: station: got '{mapping.station}', the station file is of '{station.name}'"
        )
    pumps = max(map(pump_of, mapping.signal))
    if station is not None and pumps > len(station.pump):
        raise ConfigError(
            f"{mapping_path}: signal: got pump {pumps}, station '{station.name}' has {len(station.pump)}"
        )
    nominal_hz = [pump.nominal_frequency_hz for pump in station.pump] if station else []
    try:
        done = convert(paths, mapping, nominal_hz)
    except ConfigError as error:
        raise ConfigError(f"{mapping_path}: {error}") from error
    write_recording(done.recording, out)
    return told(done, mapping, out)


def told(done: Conversion, mapping: TagMapping, out: Path) -> dict[str, object]:
    """What a conversion has made, assumed and left out, for print."""
    recording = done.recording
    columns = [
        {
            "column": name,
            "tag": mapping.tag_of(name),
            "values": int(np.sum(np.isfinite(values))),
            "low": _shown(np.fmin.reduce(values)),
            "high": _shown(np.fmax.reduce(values)),
        }
        for name, values in recording.columns.items()
    ]
    steps_s = np.diff(recording.time_ns) / NS_PER_S
    told: dict[str, object] = {
        "recording": str(out),
        "station": recording.station,
        "value": recording.value,
        "rows": len(recording),
        "first": to_iso(int(recording.time_ns[0])),
        "last": to_iso(int(recording.time_ns[-1])),
        "step_s": float(np.median(steps_s)) if steps_s.size else None,
        "columns": columns,
        "assumed": done.assumed,
        "unreadable": done.refused,
    }
    if done.main_flows:
        told["rows_of_mains"] = [_of_main(name, flow) for name, flow in done.main_flows.items()]
    if done.bad_quality:
        told["left_out_for_quality"] = done.bad_quality
    if done.doubled:
        told["stamps_that_came_again"] = done.doubled
    if done.undecided:
        told["stamps_in_a_doubled_hour_taken_for_the_first"] = done.undecided
    unmapped = [
        {"tag": tag, "rows": rows} if rows is not None else {"tag": tag} for tag, rows in done.unmapped.items()
    ]
    return told | {"unmapped": unmapped}


def _of_main(name: str, flow: HandedOut) -> dict[str, object]:
    """Whose flow the meter of a main told, in how many rows, and the highest that it read while all pumps stood."""
    return {
        "signal": name,
        "pumps": ", ".join(map(str, flow.flow_m3h)),
        "of_one": flow.one_runs,
        "several_so_none": flow.several_run,
        "unknown_so_none": flow.unknown,
        "standing_so_0": flow.none_runs,
        "up_to": _shown(flow.high_m3h),
    }


def _shown(value: float) -> float | None:
    return float(f"{value:.6g}") if np.isfinite(value) else None


def draft_mapping(paths: Sequence[Path], out: Path) -> dict[str, object]:
    """Write a mapping drafted from an export; what it assumes, and the tags that it does not use.

    Raises
    ------
    ConfigError
        If the file is there already: somebody may have completed it.
    RecordingError
        If the export cannot be read, or the file cannot be written.
    """
    if out.exists():
        raise ConfigError(f"--draft: {out} is there already, give another name")
    draft = draft_of(paths)
    with atomic_file(out) as file:
        file.write(draft.text.encode())
    return {"mapping": str(out), "assumed": draft.assumed, "unmapped": [{"tag": tag} for tag in draft.unmapped]}
