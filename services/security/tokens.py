"""Tokens for who looks at the dashboard or acts on alarms: a file of names, roles and hashes.

A token is 256 random bits, so one SHA-256 of it tells nothing: a slow hash is for passwords that people think of.
The file is read at each check. A token that is revoked is refused from then on.
"""

import hashlib
import hmac
import os
import pwd
import secrets
import time
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Annotated, get_args

import tomli_w
from pydantic import Field, ValidationError

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.station.station_file import NAME_PATTERN, load_toml
from wetwell.protocols.station.table import Table
from wetwell.services.security.audit import Audit, audit_in
from wetwell.services.security.role import Role

PREFIX = "wetwell_"
"""By it, a search for secrets finds a token that was left in a file."""


class Holder(Table):
    """Who holds a token, what it allows, and its last day in UTC; without one it does not end."""

    name: Annotated[str, Field(pattern=NAME_PATTERN)]
    role: Role
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$", repr=False)]
    until: date | None = None

    def may(self, role: Role) -> bool:
        """Whether this holder may do what a role may.

        Examples
        --------
        >>> Holder(name="control-room", role="operator", sha256="0" * 64).may("viewer")
        True
        """
        order = get_args(Role)
        return bool(order.index(self.role) >= order.index(role))

    def has_ended(self, today: date) -> bool:
        """Whether its last day is over."""
        return self.until is not None and today > self.until


class Revoked(Table):
    """A token that was taken back, so that its use is known for what it is."""

    name: Annotated[str, Field(pattern=NAME_PATTERN)]
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$", repr=False)]


class _File(Table):
    token: tuple[Holder, ...] = ()
    revoked: tuple[Revoked, ...] = ()


def holder_of(file: Path, token: str) -> Holder | None:
    """Who holds this token; None if nobody does, or not any more. Takes as long for a wrong token as for a right one.

    Raises
    ------
    ConfigError
        If the file cannot be read or breaks a rule: then nobody may be let in.
    """
    digest, found = _digest(token), None
    for holder in read_holders(file):
        if hmac.compare_digest(holder.sha256, digest) and not holder.has_ended(today()):
            found = holder
    return found


def today() -> date:
    """Day in UTC, by which tokens end."""
    return datetime.now(UTC).date()


def read_holders(file: Path) -> tuple[Holder, ...]:
    """Everybody in a file of tokens.

    Raises
    ------
    ConfigError
        If the file cannot be read or breaks a rule.
    """
    return _read(file).token


def standing_of(file: Path, token: str) -> dict[str, str]:
    """Whose a token was that is refused, and why: {"token", "name"}; "unknown" without a name where it was nobody's.

    Raises
    ------
    ConfigError
        If the file cannot be read or breaks a rule.
    """
    content, digest = _read(file), _digest(token)
    for holder in content.token:
        if holder.sha256 == digest:
            return {"token": "ended", "name": holder.name}
    names = [one.name for one in content.revoked if one.sha256 == digest]
    return {"token": "revoked", "name": names[0]} if names else {"token": "unknown"}


def new_token(file: Path, name: str, role: Role, days: int = 0) -> str:
    """Make a token, and add its hash to a file, which need not exist. The token itself is kept nowhere.

    It ends after so many days; with 0 it does not. The act is in the audit beside the file before it is done.

    Raises
    ------
    ConfigError
        If the name is taken or breaks a rule, or the file cannot be read.
    RecordingError
        If the file or its audit cannot be written.
    """
    content = _read(file) if file.exists() else _File()
    if any(holder.name == name for holder in content.token):
        raise ConfigError(f"{file}: '{name}' has a token already; revoke it first")
    token = PREFIX + secrets.token_urlsafe(32)
    try:
        until = today() + timedelta(days=days) if days else None
        holder = Holder(name=name, role=role, sha256=_digest(token), until=until)
    except ValidationError as error:
        raise ConfigError(first_fault(error)) from error
    told = {"until": None if until is None else str(until), "role": role}
    audit_of(file).write(time.time_ns(), act="new token", name=name, by=user(), **told)
    _write(file, content.model_copy(update={"token": (*content.token, holder)}))
    return token


def revoke_token(file: Path, name: str) -> None:
    """Take a token back; the file remembers its hash, and the audit beside it the act.

    Raises
    ------
    ConfigError
        If nobody of this name is in it, or it cannot be read.
    RecordingError
        If the file or its audit cannot be written.
    """
    content = _read(file)
    gone = [holder for holder in content.token if holder.name == name]
    if not gone:
        raise ConfigError(f"{file}: nobody is named '{name}'")
    rest = tuple(holder for holder in content.token if holder not in gone)
    revoked = (*content.revoked, *(Revoked(name=name, sha256=holder.sha256) for holder in gone))
    audit_of(file).write(time.time_ns(), act="revoke token", name=name, by=user())
    _write(file, _File(token=rest, revoked=revoked))


def audit_of(file: Path) -> Audit:
    """Audit of a file of tokens, beside it."""
    return audit_in(file.parent, file.stem)


def user() -> str:
    """Who runs this program, by the machine: its name, or its number where that has none."""
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return f"uid {os.getuid()}"


def _read(file: Path) -> _File:
    try:
        return _File.model_validate(load_toml(file))
    except ValidationError as error:
        raise ConfigError(f"{file}: {first_fault(error)}") from error


def _write(file: Path, content: _File) -> None:
    with atomic_file(file) as out:
        os.fchmod(out.fileno(), 0o600)
        tomli_w.dump(content.model_dump(exclude_none=True), out)


def _digest(token: str) -> str:
    return hashlib.sha256(token.encode(errors="surrogateescape")).hexdigest()
