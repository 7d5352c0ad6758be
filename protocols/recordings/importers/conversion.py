"""An export turned into a recording by a mapping, and what was assumed and left out on the way."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.quantities import pump_column
from wetwell.protocols.recordings.importers.mapping import TagMapping
from wetwell.protocols.recordings.importers.reader import ExportReader
from wetwell.protocols.recordings.importers.signals.events import Events
from wetwell.protocols.recordings.importers.signals.main_flow import HandedOut, hand_out, runs_of
from wetwell.protocols.recordings.importers.signals.rows import coincide, found_step_s, on_grid, on_union
from wetwell.protocols.recordings.importers.tables.block import ExportFile
from wetwell.protocols.recordings.importers.tables.opening import open_export
from wetwell.protocols.recordings.importers.times.stamp_column import form_of
from wetwell.protocols.recordings.importers.times.time_format import TimeFormat
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S

_MOST_NAMED = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class Conversion:
    """A recording made of an export.

    Attributes
    ----------
    recording : Recording
    assumed : dict
        What the mapping does not say and was found by looking.
    refused : list of dict
        What could not be read: rows, why, and the first of them.
    bad_quality : dict
        Values of each signal that were left out, as their quality is not good.
    unmapped : dict
        Tags that the mapping does not name; in long files with their rows.
    doubled : int
        Rows at a stamp that their tag had already; the last one counts.
    undecided : int
        Stamps of a doubled hour that could be of the first or the second time; the first is taken.
    main_flows : dict of signal to HandedOut
        What became of the flow of each main.
    """

    recording: Recording
    assumed: dict[str, str]
    refused: list[dict[str, object]]
    bad_quality: dict[str, int]
    unmapped: dict[str, int | None]
    doubled: int
    undecided: int
    main_flows: dict[str, HandedOut]


def convert(paths: Sequence[Path], mapping: TagMapping, nominal_hz: Sequence[float] = ()) -> Conversion:
    """Recording of the files of an export.

    Parameters
    ----------
    paths : sequence of Path
        Files of a day each, of a tag each, or one.
    mapping : TagMapping
    nominal_hz : sequence of float
        Nominal frequency of each pump, if its station file is known. [Hz]

    Raises
    ------
    RecordingError
        If a file cannot be read, does not fit the mapping, or no row of it can be read.
    ConfigError
        If the mapping lacks something that these files need.
    """
    files = [open_export(path, mapping) for path in paths]
    _check_memory(files, len(mapping.signal))
    assumed = _looked_up(files)
    if mapping.time_format:
        form: TimeFormat | None = TimeFormat.of(mapping.time_format)
    else:
        form = form_of(files, mapping.columns.time, mapping.columns.date)
        assumed |= {"time_format": repr(form.name)} if form else {}
    reader = ExportReader(mapping, form, nominal_hz)
    try:
        for file in files:
            reader.read(file)
        _check_tags(files, mapping, reader)
        zone = ZoneInfo(mapping.time_zone) if mapping.time_zone else None
        events, undecided = reader.store.events(zone, reader.refusals)
        if not any(part.time_ns.size for part in events):
            first = next((f"; {row['why']}: {row['first']}" for row in reader.refusals.table()), "")
            raise RecordingError(f"{paths[0]}: no row could be read{first}")
        time_ns, columns = _rows(events, mapping, assumed)
    except ValueError as error:
        raise ConfigError(str(error)) from error
    none = np.full(time_ns.size, np.nan)
    main_flows = {
        main: hand_out(columns.get(main, none), runs_of(columns, pumps, time_ns.size))
        for main, pumps in mapping.mains.items()
    }
    ordered: dict[str, Floats] = {}
    for name in mapping.signal:
        if name in main_flows:
            ordered |= {pump_column(pump, "flow_m3h"): flow for pump, flow in main_flows[name].flow_m3h.items()}
        elif name in columns:
            ordered[name] = columns[name]
    return Conversion(
        recording=Recording(time_ns=time_ns, columns=ordered, station=mapping.station, value=mapping.value),
        assumed=assumed | reader.words,
        refused=reader.refusals.table(),
        bad_quality={name: values for name, values in reader.bad_quality.items() if values},
        unmapped=_unmapped(files, mapping, reader),
        doubled=sum(int(np.sum(np.diff(part.time_ns) == 0)) for part in events),
        undecided=undecided,
        main_flows=main_flows,
    )


def _check_memory(files: Sequence[ExportFile], signals: int) -> None:
    needed = sum(file.needed_bytes(signals) for file in files)
    here = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if needed > here:
        raise RecordingError(
            f"{files[0].path}: needs about {needed / 1e9:.1f} GB of memory, this machine has {here / 1e9:.1f}: "
            "convert its days as files of their own"
        )


def _looked_up(files: Sequence[ExportFile]) -> dict[str, str]:
    """What was found by looking, once for all files that are alike."""
    assumed = dict(files[0].assumed)
    for file in files[1:]:
        others = {name: text for name, text in file.assumed.items() if assumed.get(name) != text}
        assumed |= {f"{file.path}: {name}": text for name, text in others.items()}
    return assumed


def _check_tags(files: Sequence[ExportFile], mapping: TagMapping, reader: ExportReader) -> None:
    names = reader.tag_rows if mapping.layout == "long" else chain(*(file.names for file in files))
    known = list(dict.fromkeys(names))
    for name, signal in mapping.signal.items():
        for key, header in (("tag", signal.tag), ("quality", signal.quality)):
            if header is not None and header not in known:
                named = ", ".join(map(repr, known[:_MOST_NAMED]))
                more = f" and {len(known) - _MOST_NAMED} more" if len(known) > _MOST_NAMED else ""
                raise ConfigError(f"signal.{name}.{key}: got '{header}', the files have {named}{more}")


def _unmapped(files: Sequence[ExportFile], mapping: TagMapping, reader: ExportReader) -> dict[str, int | None]:
    mapped = {signal.tag for signal in mapping.signal.values()}
    if mapping.layout == "long":
        return {tag: rows for tag, rows in reader.tag_rows.items() if tag and tag not in mapped}
    mapped |= {mapping.columns.time, mapping.columns.date or ""}
    mapped |= {signal.quality or "" for signal in mapping.signal.values()}
    return {name: None for name in dict.fromkeys(chain(*(file.names for file in files))) if name not in mapped}


def _rows(
    events: Sequence[Events], mapping: TagMapping, assumed: dict[str, str]
) -> tuple[Integers, Mapping[str, Floats]]:
    """Rows of the file, or of a grid where one is asked for or the tags have no rows in common."""
    step_s = mapping.step_s
    is_held = mapping.value == "held"
    if step_s is None and (is_held or not coincide(events)):
        step_s = found_step_s(events)
        assumed["step_s"] = f"{step_s:g}" + ("" if is_held else ", as the stamps of the tags do not coincide")
    if step_s is None:
        return on_union(events)
    step_ns = round(step_s * NS_PER_S)
    max_age_ns = {
        name: round((signal.max_age_s or mapping.max_age_s or 0.0) * NS_PER_S) if is_held else step_ns - 1
        for name, signal in mapping.signal.items()
    }
    return on_grid(events, step_ns, max_age_ns)
