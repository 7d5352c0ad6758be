"""Page of a validation: level, starts and run time, measured beside simulated."""

import numpy as np

from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S, to_iso
from wetwell.services.reports.charts import Section, Series, bar_chart, line_chart, page, paragraph, table
from wetwell.sim2real.calibration.validation import Validation

CLOSE_UP_S = 6 * 3600


def validation_page(station: Station, measured: Recording, simulated: Recording, result: Validation) -> str:
    """Self-contained HTML page of a validation and the two recordings that it compares.

    Returns
    -------
    html : str
    """
    errors = [("level, over its range", result.level_nmae)]
    for name, values in (("starts a day", result.starts_nmae), ("run time a day", result.run_h_nmae)):
        errors += [(f"pump {pump}: {name}", float(value)) for pump, value in enumerate(values, start=1)]
    begin_ns, end_ns = int(measured.time_ns[0]), int(measured.time_ns[-1])
    parts = [paragraph(f"{to_iso(begin_ns)} to {to_iso(end_ns)}, {len(measured)} rows; inflow {result.inflow}.")]
    parts.append(table(["normalised mean absolute error", ""], [(name, _share(value)) for name, value in errors]))
    levels = [_level("Level", measured, simulated, station, end_ns)]
    if end_ns - begin_ns > 2 * CLOSE_UP_S * NS_PER_S:
        levels.append(
            _level("Level, the first six hours", measured, simulated, station, begin_ns + CLOSE_UP_S * NS_PER_S)
        )
    bars = []
    starts = result.starts.astype(np.float64)
    for title, label, figures in (("starts", "starts a day", starts), ("run time", "h a day", result.run_h)):
        for pump in range(len(station.pump)):
            groups = {"measured": figures[0, :, pump], "simulated": figures[1, :, pump]}
            bars.append(bar_chart(f"Pump {pump + 1}: {title}", result.days, groups, y_label=label))
    return page(
        f"Validation of station {station.name}",
        [
            Section("Errors", "".join(parts)),
            Section("Level", "".join(levels)),
            Section("Starts and run time", "".join(bars)),
        ],
    )


def _level(title: str, measured: Recording, simulated: Recording, station: Station, until_ns: int) -> str:
    kept = measured.time_ns <= until_ns
    series = [
        Series(name, recording.time_ns[kept], recording.column("level_m")[kept])
        for name, recording in (("measured", measured), ("simulated", simulated))
    ]
    control = station.control
    limits = {"first start": control.start_levels_m[0], "first stop": control.stop_levels_m[0]}
    return line_chart(title, series, y_label="level in m", is_time=True, limits=limits)


def _share(value: float) -> str:
    return f"{value:.2%}" if np.isfinite(value) else "–"
