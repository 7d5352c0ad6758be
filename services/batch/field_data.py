"""Work on recordings from the field: prepare, calibrate, validate."""

from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from pydantic import ValidationError

from wetwell.protocols.arrays import Floats
from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import ConfigError, RecordingError, first_fault
from wetwell.protocols.quantities import PUMP_METERS
from wetwell.protocols.recordings.reading import PLAIN, Reading
from wetwell.protocols.recordings.recording import Recording, write_recording
from wetwell.protocols.station.station_file import Station, load_toml
from wetwell.protocols.timestamps import to_iso
from wetwell.services.reports.validation_page import validation_page
from wetwell.sim2real.calibration.calibration import calibrate
from wetwell.sim2real.calibration.comparison import Errors, compare
from wetwell.sim2real.calibration.fitted_station import with_estimates
from wetwell.sim2real.calibration.validation import validate
from wetwell.sim2real.recording.preparation import Preparation, PreparationReport, prepare
from wetwell.sim2real.replay.units import check_units


def prepared(
    recording: Path, preparation: Path | None, station: Station | None, reading: Reading
) -> tuple[Recording, PreparationReport]:
    """Recording of a station in a file, prepared as a TOML file says, or only sorted and without doubles.

    Raises
    ------
    ConfigError
        If the preparation breaks a rule or does not fit the recording.
    RecordingError
        If the recording cannot be read, or is not of the station.
    """
    table = load_toml(preparation) if preparation is not None else {}
    place = preparation if preparation is not None else recording
    try:
        rows = reading.read(recording) if station is None else reading.read_of(recording, station)
        return prepare(rows, Preparation.model_validate(table))
    except ValidationError as error:
        raise ConfigError(f"{place}: {first_fault(error)}") from error
    except ValueError as error:
        raise ConfigError(f"{place}: {error}") from error


def prepare_file(
    recording: Path, preparation: Path | None, out: Path, station: Station | None, reading: Reading
) -> dict[str, Any]:
    """Write a prepared recording; what was found and done."""
    rows, report = prepared(recording, preparation, station, reading)
    write_recording(rows, out)
    return {
        "recording": str(out),
        "rows": report.rows,
        "shifted": report.shifted,
        "out_of_order": report.out_of_order,
        "doubled": report.doubled,
        "max_gap_s": report.max_gap_s,
        "gaps": [{"start": to_iso(gap.start_ns), "length_s": gap.length_s} for gap in report.gaps],
    }


def calibrate_file(
    station: Station, recording: Path, preparation: Path | None, out: Path, reading: Reading = PLAIN
) -> dict[str, Any]:
    """Write a station file fitted to a recording; the estimates with their intervals.

    Raises
    ------
    RecordingError
        If the recording cannot be used or the station file cannot be written.
    """
    rows, _ = prepared(recording, preparation, station, reading)
    try:
        check_units(rows, station)
        estimates = calibrate(rows, station)
        fitted = with_estimates(station, estimates)
    except ValueError as error:
        raise RecordingError(f"{recording}: {error}") from error
    write_station(fitted, out)
    return {
        "station": str(out),
        "parameters": [
            {
                "name": estimate.name,
                "value": float(f"{estimate.value:.6g}"),
                "low": None if estimate.interval is None else float(f"{estimate.interval[0]:.6g}"),
                "high": None if estimate.interval is None else float(f"{estimate.interval[1]:.6g}"),
                "prior": None if estimate.prior is None else float(f"{estimate.prior[0]:.6g}"),
                "prior_sd": None if estimate.prior is None else float(f"{estimate.prior[1]:.3g}"),
                "unit": estimate.unit,
                "reason": estimate.reason,
            }
            for estimate in estimates
        ],
    }


def validate_file(
    station: Station,
    recording: Path,
    preparation: Path | None,
    out: Path | None,
    html: Path | None = None,
    reading: Reading = PLAIN,
    *,
    before: Station | None = None,
) -> dict[str, Any]:
    """Compare a station with a recording, row by row, and where levels drive it the free-running simulator too.

    `before` is compared row by row beside it. The simulated recording and a page are written where asked.

    Raises
    ------
    ConfigError
        If `out` or `html` is asked of a station that is not driven by levels.
    RecordingError
        If the recording cannot be used, or a file cannot be written.
    """
    if station.control.is_external and (out is not None or html is not None):
        raise ConfigError(f"station '{station.name}': control.mode 'external': there is no simulated recording")
    rows, _ = prepared(recording, preparation, station, reading)
    try:
        check_units(rows, station)
        table = [_error_row(error) for error in _errors(rows, station)]
        for row, error in zip(table, _errors(rows, before) if before is not None else (), strict=False):
            row |= {f"before_{key}": value for key, value in _error_row(error).items() if key.startswith("steady_m")}
        if station.control.is_external:
            return {"closed_loop": "control.mode 'external': no levels start pumps", "row_by_row": table}
        result, simulated = validate(rows, station)
    except ValueError as error:
        raise RecordingError(f"{recording}: {error}") from error
    if out is not None:
        write_recording(simulated, out)
    if html is not None:
        with atomic_file(html) as file:
            file.write(validation_page(station, rows, simulated, result).encode())
    days = [
        {
            "day": day,
            "pump": pump + 1,
            "name": station.pump_labels[pump],
            "starts_measured": int(result.starts[0, row, pump]),
            "starts_simulated": int(result.starts[1, row, pump]),
            "run_h_measured": round(float(result.run_h[0, row, pump]), 3),
            "run_h_simulated": round(float(result.run_h[1, row, pump]), 3),
        }
        for row, day in enumerate(result.days)
        for pump in range(len(station.pump))
    ]
    return {
        "level_nmae": round(result.level_nmae, 5),
        "starts_nmae": _rounded(result.starts_nmae),
        "run_h_nmae": _rounded(result.run_h_nmae),
        "inflow": result.inflow,
        "days": days,
        "row_by_row": table,
    }


def _errors(rows: Recording, station: Station) -> list[Errors]:
    """Errors of all pumps and mains in what the recording measures."""
    comparison = compare(rows, station)
    return [error for quantity in PUMP_METERS for error in comparison.errors(quantity) if error.rows > 0]


def _error_row(error: Errors) -> dict[str, Any]:
    """Row of a table, in the order in which it is read."""
    return {
        "what": error.what,
        "quantity": error.quantity,
        "steady_rows": error.steady_rows,
        "steady_median": _share(error.steady_median),
        "steady_rms": _share(error.steady_rms),
        "bias": _share(error.steady_bias),
        "rows": error.rows,
        "rms": _share(error.rms),
    }


def _share(value: float) -> float | None:
    return round(value, 4) if np.isfinite(value) else None


def _rounded(values: Floats) -> list[float | None]:
    return [round(value, 5) if np.isfinite(value) else None for value in values.tolist()]


def write_station(station: Station, out: Path) -> None:
    """Write a station file; it appears whole or not at all.

    Raises
    ------
    RecordingError
        If it cannot be written.
    """
    with atomic_file(out) as file:
        file.write(tomli_w.dumps(station.model_dump(exclude_none=True)).encode())
