"""A case in the folder of a trial: two files published, its labels sealed."""

import math
import secrets
from dataclasses import asdict
from pathlib import Path

import tomli_w

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import RecordingError
from wetwell.protocols.recordings.recording import write_recording
from wetwell.services.trial.material_case import material_case
from wetwell.sim2real.trial.cases import TrialCase
from wetwell.sim2real.trial.scores import Label
from wetwell.sim2real.trial.seal import digest, labels_text, opened

STATION_FILE, RECORDING_FILE, SEAL_FILE = "station.toml", "recording.parquet", "seal.sha256"


def published_in(folder: Path, name: str) -> Path:
    """Where the folder of a trial holds what is published of a case."""
    return folder / "published" / name


def _sealed_in(folder: Path, name: str) -> Path:
    return folder / "sealed" / f"{name}.json"


def is_published(case: TrialCase, folder: Path) -> bool:
    """Whether the folder of a trial holds a case with its seal."""
    return (published_in(folder, case.name) / SEAL_FILE).is_file() and _sealed_in(folder, case.name).is_file()


def publish(case: TrialCase, folder: Path) -> None:
    """Write station file and recording of a case, its labels under seal, and the hash of the seal.

    Raises
    ------
    WetwellError
        If one of its deviations never matters (`material_case`), or its plant is not installed.
    """
    case, truth, recording = material_case(case)
    published, sealed = published_in(folder, case.name), _sealed_in(folder, case.name)
    published.mkdir(parents=True, exist_ok=True)
    sealed.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(published / STATION_FILE) as file:
        tomli_w.dump(truth.station.model_dump(mode="json", exclude_none=True), file)
    write_recording(recording, published / RECORDING_FILE)
    labels = {
        "case": case.name,
        "kind": case.kind,
        "plant": case.plant,
        "attempt": case.attempt,
        "names": list(case.names),
        "components": list(case.components),
        "parameters": {deviation.name: dict(deviation.parameters) for deviation in truth.deviations},
        "inherent": [*case.family.inherent, *truth.storage.inherent],
        "truth_seed": truth.seed,
        "slow_share": truth.slow_share,
        "storage": {**asdict(truth.storage), "report_s": _finite(truth.storage.report_s)},
        "sha256": {name: digest((published / name).read_bytes()) for name in (STATION_FILE, RECORDING_FILE)},
    }
    text = labels_text(labels, secrets.token_hex(16))
    with atomic_file(sealed) as file:
        file.write(text)
    with atomic_file(published / SEAL_FILE) as file:
        file.write(digest(text).encode() + b"\n")


def open_case(name: str, folder: Path) -> Label:
    """Labels of a case, once seal and published files are found to be what they were.

    Raises
    ------
    RecordingError
        If one has been changed or is missing.
    """
    published, sealed = published_in(folder, name), _sealed_in(folder, name)
    try:
        labels = opened(sealed.read_bytes(), (published / SEAL_FILE).read_text(encoding="ascii"))
        changed = [part for part, was in labels["sha256"].items() if digest((published / part).read_bytes()) != was]
    except OSError as error:
        raise RecordingError(f"{error.filename}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise RecordingError(f"{sealed}: {error}") from error
    if changed:
        raise RecordingError(f"{published / changed[0]}: is not what was sealed: its SHA-256 differs")
    return Label(
        case=labels["case"],
        kind=labels["kind"],
        plant=labels["plant"],
        names=tuple(labels["names"]),
        components=tuple(labels["components"]),
        parameters=labels["parameters"],
        inherent=tuple(labels["inherent"]),
        attempt=labels["attempt"],
        every_s=labels["storage"]["every_s"],
        value=labels["storage"]["value"],
        absent=tuple(labels["storage"]["absent"]),
        slow_share=labels["slow_share"],
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
