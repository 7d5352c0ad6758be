"""Start and stop of a daemon, written into the audit with its settings and a sum of the state that it keeps."""

import contextlib
import hashlib
import json
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

from wetwell.protocols.errors import ConfigError
from wetwell.services.runtime.clock import now_ns
from wetwell.services.runtime.settings import Settings
from wetwell.services.security.audit import audit_in
from wetwell.services.security.audit_chain import entries_of
from wetwell.services.security.file_sum import file_sum


@contextlib.contextmanager
def written_down(settings: Settings, service: str) -> Iterator[None]:
    """Write down that a service starts, with its settings as far as they are not the defaults, and that it stops.

    Secrets are masked. Where a state is there at the start that is not the one of the last stop, such as that of a
    backup, the start says so. A disk that refuses is told, and the service runs all the same.

    Raises
    ------
    ConfigError
        If the folder of the audit cannot be made.
    """
    folder = settings.security.audit_dir
    if folder is not None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigError(f"security.audit_dir: {folder}: {error.strerror or error}") from error
    audit = audit_in(folder, service)
    changed = json.loads(settings.model_dump_json(exclude_defaults=True))
    told: dict[str, object] = {"service": service, "version": version("wetwell"), "settings": changed}
    if _is_replaced(audit.path, sum_of_state(settings, service)):
        told["state"] = "not that of the last stop"
    audit.note(now_ns(), act="start", **told)
    try:
        yield
    finally:
        audit.note(now_ns(), act="stop", service=service, state=sum_of_state(settings, service))


def sum_of_state(settings: Settings, service: str) -> str | None:
    """SHA-256 over the files of the state of a service, by their names; None where it keeps none."""
    folders = {
        "detector": settings.detector.state_dir,
        "alarms": settings.alarms.state_dir,
        "gap": settings.watch.state_dir,
    }
    folder = folders.get(service)
    files = [] if folder is None else sorted(folder.glob("*.json"))
    if not files:
        return None
    state = hashlib.sha256()
    for file in files:
        with contextlib.suppress(OSError):
            state.update(file.name.encode() + bytes.fromhex(file_sum(file)))
    return state.hexdigest()


def _is_replaced(path: Path | None, state: str | None) -> bool:
    """Whether the last thing that is known of a service is that it stopped with another state."""
    known = [] if path is None else [entry for entry in entries_of(path) if entry.get("act") in {"start", "stop"}]
    return bool(known) and known[-1]["act"] == "stop" and known[-1].get("state") != state
