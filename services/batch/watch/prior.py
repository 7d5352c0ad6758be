"""Priors of a fleet in files: made of reports and of watched gaps, written, read."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from pydantic import ValidationError

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.services.watch.state_file import WATCH_SUFFIX, read_state
from wetwell.sim2real.diagnosis.report import GapReport
from wetwell.sim2real.fleet.fleet_prior import Finding, FleetPrior, fleet_prior
from wetwell.sim2real.watch.finding import finding_of

REPORT = "report.json"


def prior_of_folders(folders: Sequence[Path], without: str | None = None) -> FleetPrior:
    """Prior from all reports of diagnoses and all watched gaps in some folders, at any depth.

    Of a station with several the newest file counts.

    Parameters
    ----------
    folders : sequence of Path
    without : str, optional
        Station that is to be diagnosed.

    Raises
    ------
    ConfigError
        If a folder holds none, or a file is no report or state.
    """
    newest: dict[str, tuple[int, Finding]] = {}
    for folder in folders:
        files = sorted([*folder.rglob(REPORT), *folder.rglob(f"*{WATCH_SUFFIX}")])
        if not files:
            raise ConfigError(
                f"{folder}: must hold reports of diagnoses ({REPORT}) or watched gaps (*{WATCH_SUFFIX})"
            )
        for file in files:
            for finding in _findings(file):
                found = (file.stat().st_mtime_ns, finding)
                if finding.station not in newest or newest[finding.station][0] < found[0]:
                    newest[finding.station] = found
    return fleet_prior([finding for _, finding in newest.values()], without)


def write_prior(prior: FleetPrior, out: Path) -> None:
    """Write a prior; the file appears whole.

    Raises
    ------
    RecordingError
        If it cannot be written.
    """
    with atomic_file(out) as file:
        file.write(prior.model_dump_json(by_alias=True, indent=2).encode() + b"\n")


def read_prior(path: Path) -> FleetPrior:
    """Prior in a file.

    Raises
    ------
    ConfigError
        If it cannot be read, or is none.
    """
    try:
        return FleetPrior.model_validate_json(path.read_bytes())
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except ValidationError as error:
        raise ConfigError(f"{path}: {first_fault(error)}") from error


def _findings(file: Path) -> Iterator[Finding]:
    try:
        if file.name == REPORT:
            report = GapReport.model_validate_json(file.read_bytes())
            if report.prior_stations == 0 and report.verdict != "unknown":
                yield Finding(station=report.station, effects=report.effects)
        elif (finding := finding_of(read_state(file.read_bytes()))) is not None:
            yield finding
    except OSError as error:
        raise ConfigError(f"{file}: cannot be read: {error.strerror}") from error
    except ValidationError as error:
        raise ConfigError(f"{file}: {first_fault(error)}") from error
    except ValueError as error:
        raise ConfigError(f"{file}: {error}") from error


def prior_rows(prior: FleetPrior) -> dict[str, object]:
    """Tables for people: effects that some station has, and parameters whose spread is known."""
    effects = [
        {"effect": name, "stations": one.stations, "times as usual as the mean": round(one.weight, 2)}
        for name, one in sorted(prior.effects.items(), key=lambda pair: -pair[1].weight)
        if one.stations
    ]
    parameters = [
        {
            "effect": effect,
            "parameter": name,
            "mean": one.mean,
            "sd": float(f"{one.sd:.3g}"),
            "unit": one.unit,
            "stations": one.stations,
        }
        for effect, found in prior.parameters.items()
        for name, one in found.items()
    ]
    return {"stations": prior.stations, "effects": effects or "none", "parameters": parameters or "none"}
