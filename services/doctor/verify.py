"""Whether what is kept on this machine is what was written: checksums over history, checkpoints, alarms and audit."""

from collections.abc import Iterator
from pathlib import Path

from pydantic import ValidationError

from wetwell.services.alarms.state_file import STATE_NAME, DamagedStateError, read_state
from wetwell.services.detector.checkpoint import is_intact
from wetwell.services.doctor.finding import Finding
from wetwell.services.historian.store.archive import Archive
from wetwell.services.historian.store.live.salvage import damage_of
from wetwell.services.runtime.settings import Settings
from wetwell.services.security.audit_chain import audits_in, damage_in
from wetwell.services.watch.state_file import WATCH_SUFFIX, is_whole

MOST_TOLD = 5
"""Of damages of one kind; of others their number is told."""


def verify_kept(settings: Settings) -> list[Finding]:
    """All that is found in the folders that the settings name. Changes nothing; daemons may run meanwhile."""
    findings = [
        *_history(settings),
        *_checkpoints(settings.detector.state_dir),
        *_alarms(settings.alarms.state_dir),
        *_audits(settings),
        *_watches(settings.watch.state_dir),
    ]
    return findings or [Finding("verify", "warning", "nothing is kept here", "name the folders: --config FILE")]


def _history(settings: Settings) -> Iterator[Finding]:
    folder = settings.historian.folder
    if settings.historian.url is not None:
        yield Finding("history", "ok", "the history is in PostgreSQL: turn its data_checksums on")
        return
    if not (folder / "live.sqlite").exists():
        return
    advice = "stop the historian, move the file away, and bring it back from a backup or by wetwell import"
    yield _finding("history", f"{folder / 'live.sqlite'}", damage_of(folder / "live.sqlite"), advice)
    yield _finding("history", f"daily files in {folder}", Archive(folder).damage(), advice)


def _checkpoints(folder: Path | None) -> Iterator[Finding]:
    files = [] if folder is None else sorted(folder.glob("*.detector.json"))
    if files:
        damaged = [file.name for file in files if not is_intact(file.read_bytes())]
        advice = "the detector puts it aside at its next start and learns anew; or bring a backup back"
        yield _finding("detector", f"{len(files)} checkpoints in {folder}", damaged, advice)


def _alarms(folder: Path | None) -> Iterator[Finding]:
    if folder is None:
        return
    state = folder / STATE_NAME
    if state.exists():
        try:
            read_state(state.read_bytes())
            damage = []
        except (DamagedStateError, ValidationError):
            damage = [state.name]
        yield _finding("alarms", str(state), damage, "they begin anew at their next start; or bring a backup back")


def _audits(settings: Settings) -> Iterator[Finding]:
    """Each audit there is: of alarms, of the daemons, of imports, and of tokens beside their file."""
    tokens_file = settings.security.tokens_file
    folders = [settings.alarms.state_dir, settings.security.audit_dir, settings.historian.folder]
    folders += [] if tokens_file is None else [tokens_file.parent]
    for audit in sorted({path for folder in folders if folder is not None for path in audits_in(folder)}):
        advice = "compare it with a backup: lines were changed, lost or put in"
        yield _finding("audit", str(audit), damage_in(audit), advice)


def _watches(folder: Path | None) -> Iterator[Finding]:
    files = [] if folder is None else sorted(folder.glob(f"*{WATCH_SUFFIX}"))
    if files:
        damaged = [file.name for file in files if not is_whole(file.read_bytes())]
        advice = "the watch puts it aside at its next start and begins anew; or bring a backup back"
        yield _finding("watch", f"{len(files)} watched gaps in {folder}", damaged, advice)


def _finding(check: str, place: str, damage: list[str], advice: str) -> Finding:
    if not damage:
        return Finding(check, "ok", f"{place}: what was written")
    told = [*damage[:MOST_TOLD], *([f"{len(damage) - MOST_TOLD} more"] if len(damage) > MOST_TOLD else [])]
    return Finding(check, "error", f"{place}: damaged: {'; '.join(told)}", advice)
