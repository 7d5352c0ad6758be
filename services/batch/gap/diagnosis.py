"""Diagnose recordings in files: reads and writes, nothing else."""

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.quantities import PUMP_METERS, pump_column
from wetwell.protocols.recordings.reading import PLAIN, Reading
from wetwell.protocols.recordings.recording import Recording, write_recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.batch.field_data import prepared, write_station
from wetwell.services.reports.gap.page import gap_page
from wetwell.sim2real.calibration.validation import Validation, validate, validation_of
from wetwell.sim2real.diagnosis.diagnosis import Diagnosis, diagnose
from wetwell.sim2real.diagnosis.false_verdicts import false_verdicts
from wetwell.sim2real.diagnosis.report import ClosedLoop, ClosedLoopComparison, DetectorVerdicts, GapReport
from wetwell.sim2real.experiments.left_open import left_open
from wetwell.sim2real.fleet.fleet_prior import FleetPrior
from wetwell.sim2real.likelihood.priors import EVEN
from wetwell.sim2real.recording.preparation import PreparationReport
from wetwell.sim2real.recording.seconds import trailing_means
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.simulator.effects import LIBRARY, effects_of

LEFT_OPEN = "left_open.json"
"""What `wetwell gap experiment` reads of a diagnosis."""
MISSED = 1.5
"""Pause over that from row to row, from which a row is missing."""
THREADS = min(os.cpu_count() or 1, 4)
"""The replay is compiled and holds no lock, so that threads try effects side by side."""


def diagnose_file(
    station: Station,
    recordings: Sequence[Path],
    out: Path,
    reading: Reading = PLAIN,
    *,
    only: Iterable[str] | None = None,
    without: Iterable[str] = (),
    progress: Callable[[float], None] = lambda _: None,
    prior: FleetPrior | None = None,
) -> GapReport:
    """Write `report.json`, `report.html`, `station.toml` and `left_open.json` into a folder.

    It is made where it is missing. Several recordings are diagnosed as one.

    Raises
    ------
    ConfigError
        If an effect is not in the library.
    RecordingError
        If the recording cannot be used, or the folder not be written.
    """
    check_effects([*(only or ()), *without])
    rows = [prepared(recording, None, station, reading) for recording in recordings]
    try:
        report, diagnosis = diagnose_rows(station, rows, only=only, without=without, progress=progress, prior=prior)
    except ValueError as error:
        raise RecordingError(f"{', '.join(map(str, recordings))}: {error}") from error
    page = gap_page(report, diagnosis)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{out}: cannot be made: {error.strerror}") from error
    write_station(diagnosis.station, out / "station.toml")
    left = left_open(station, diagnosis.conditions, diagnosis.attribution.possible)
    for name, text in (
        (LEFT_OPEN, left.model_dump_json(by_alias=True, indent=2) + "\n"),
        ("report.html", page),
        ("report.json", report.model_dump_json(by_alias=True, indent=2) + "\n"),
    ):
        with atomic_file(out / name) as file:
            file.write(text.encode())
    return report


def check_effects(names: Iterable[str]) -> None:
    """Refuse effects that there are not.

    Raises
    ------
    ConfigError
        Names the first.
    """
    for name in names:
        if name not in LIBRARY:
            raise ConfigError(f"effect '{name}' is not in the library: wetwell effects lists it")


def diagnose_rows(
    station: Station,
    rows: Sequence[tuple[Recording, PreparationReport]],
    *,
    only: Iterable[str] | None = None,
    without: Iterable[str] = (),
    progress: Callable[[float], None] = lambda _: None,
    prior: FleetPrior | None = None,
) -> tuple[GapReport, Diagnosis]:
    """Report of a diagnosis, and the diagnosis.

    Parameters
    ----------
    station : Station
    rows : sequence of Recording and PreparationReport
        Prepared recordings; several are diagnosed as one. The closed loop and the detector are shown the longest.
    only, without : names of effects
        Restrict the library.
    progress : callable
        Gets the share of the work that is done.

    Raises
    ------
    ValueError
        If the recording cannot be diagnosed.
    """
    recordings = [recording for recording, _ in rows]
    longest = max(recordings, key=len)
    with ThreadPoolExecutor(THREADS) as pool:
        diagnosis = diagnose(
            recordings,
            station,
            only=only,
            without=without,
            progress=progress,
            each=pool.map,
            priors=EVEN if prior is None else prior.priors,
        )
        closed_loop = pool.submit(_closed_loop, longest, station, diagnosis.station)
        detector = pool.submit(_detector, longest, station, diagnosis.station)
        report = diagnosis.report(
            closed_loop.result(),
            detector.result(),
            tuple(note for _, preparation in rows for note in _notes(preparation, diagnosis.traces.rate_s)),
            0 if prior is None else prior.stations,
            each=pool.map,
        )
    return report, diagnosis


def replay_file(
    station: Station, recording: Path, out: Path, reading: Reading = PLAIN, *, closed_loop: bool
) -> dict[str, object]:
    """Write what the simulator says for a recording.

    Teacher-forced, frequency, inflow and level come from the recording, second by second; in a closed loop only the
    inflow does, and the simulator controls its own pumps. What is written is a mean where the recording has means.

    Raises
    ------
    RecordingError
        If the recording cannot be used or the result not be written.
    """
    rows, _ = prepared(recording, None, station, reading)
    try:
        predicted = validate(rows, station)[1] if closed_loop else _teacher_forced(rows, station)
    except ValueError as error:
        raise RecordingError(f"{recording}: {error}") from error
    write_recording(predicted, out)
    return {"recording": str(out), "rows": len(predicted), "closed_loop": closed_loop}


def _teacher_forced(rows: Recording, station: Station) -> Recording:
    traces = traces_of(rows, station)
    prediction = Replay(traces, station, effects_of(station)).run()
    second = ((rows.time_ns - rows.time_ns[0] + NS_PER_S // 2) // NS_PER_S).astype(np.int64) + traces.span_s - 1
    stored = partial(trailing_means, span_s=traces.span_s)
    columns = {"level_m": prediction.level_m[second]}
    if traces.inflow_m3h is not None:
        columns["inflow_m3h"] = stored(traces.inflow_m3h)[second]
    for i, frequency_hz in enumerate(traces.frequency_hz):
        columns[pump_column(i + 1, "frequency_hz")] = stored(frequency_hz)[second]
        for name in PUMP_METERS:
            if name in prediction.signals:
                columns[pump_column(i + 1, name)] = prediction.signals[name][i, second]
        columns[pump_column(i + 1, "running")] = stored((frequency_hz > 0.0).astype(np.float64))[second]
    return Recording(time_ns=rows.time_ns, columns=columns, station=rows.station, value=rows.value)


def _notes(preparation: PreparationReport, rate_s: float) -> tuple[str, ...]:
    """What was found out of order; a pause from row to row is no gap."""
    gaps_s = [gap.length_s for gap in preparation.gaps if gap.length_s > MISSED * rate_s]
    longest_s = max(gaps_s, default=0.0)
    said = (
        (preparation.out_of_order, "rows stood before an earlier one and were put in order"),
        (preparation.doubled, "rows with a time that was there already were dropped"),
        (len(gaps_s), f"gaps, the longest of {longest_s:.0f} s: what is in them is not judged"),
    )
    return tuple(f"{count} {text}" for count, text in said if count)


def _detector(rows: Recording, before: Station, after: Station) -> DetectorVerdicts:
    counted = false_verdicts(rows, before, after)
    return DetectorVerdicts(
        days=round(counted.days, 3),
        verdicts=counted.verdicts,
        false_per_day_before=round(counted.before / counted.days, 2),
        false_per_day_after=round(counted.after / counted.days, 2),
        has_new_curves=counted.has_new_curves,
    )


def _closed_loop(rows: Recording, before: Station, after: Station) -> ClosedLoopComparison | None:
    """Free runs under both stations; None where level or inflow do not allow one."""
    try:
        first = validation_of(rows, before)
        second = first if after == before else validation_of(rows, after)
    except ValueError:
        return None
    days = float(rows.time_ns[-1] - rows.time_ns[0]) / 86_400e9

    def figures(result: Validation, row: int) -> tuple[float, float]:
        return float(result.starts[row].sum()) / days, float(result.run_h[row].sum()) / days

    def loop(result: Validation) -> ClosedLoop:
        starts, run_h = figures(result, 1)
        return ClosedLoop(
            level_nmae=round(result.level_nmae, 5), starts_per_day=round(starts, 2), run_h_per_day=round(run_h, 3)
        )

    starts, run_h = figures(first, 0)
    return ClosedLoopComparison(
        inflow=first.inflow,
        measured_starts_per_day=round(starts, 2),
        measured_run_h_per_day=round(run_h, 3),
        before=loop(first),
        after=loop(second),
    )
