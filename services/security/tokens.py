"""Tokens for who looks at the dashboard or acts on alarms: a file of names, roles and hashes.

A token is 256 random bits, so one SHA-256 of it tells nothing: a slow hash is for passwords that people think of.
The file is read at each check. A token that is taken out of it is refused from then on.
"""

import hashlib
import hmac
import os
import secrets
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Annotated, get_args

import tomli_w
from pydantic import Field, ValidationError

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.station.station_file import NAME_PATTERN, load_toml
from wetwell.protocols.station.table import Table
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


class _File(Table):
    token: tuple[Holder, ...] = ()


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
    try:
        return _File.model_validate(load_toml(file)).token
    except ValidationError as error:
        raise ConfigError(f"{file}: {first_fault(error)}") from error


def new_token(file: Path, name: str, role: Role, days: int = 0) -> str:
    """Make a token, and add its hash to a file, which need not exist. The token itself is kept nowhere.

    It ends after so many days; with 0 it does not.

    Raises
    ------
    ConfigError
        If the name is taken or breaks a rule, or the file cannot be read.
    RecordingError
        If the file cannot be written.
    """
    holders = read_holders(file) if file.exists() else ()
    if any(holder.name == name for holder in holders):
        raise ConfigError(f"{file}: '{name}' has a token already; revoke it first")
    token = PREFIX + secrets.token_urlsafe(32)
    try:
        until = today() + timedelta(days=days) if days else None
        holder = Holder(name=name, role=role, sha256=_digest(token), until=until)
    except ValidationError as error:
        raise ConfigError(first_fault(error)) from error
    _write(file, (*holders, holder))
    return token


def revoke_token(file: Path, name: str) -> None:
    """Take a token out of a file.

    Raises
    ------
    ConfigError
        If nobody of this name is in it, or it cannot be read.
    RecordingError
        If the file cannot be written.
    """
    holders = read_holders(file)
    rest = tuple(holder for holder in holders if holder.name != name)
    if len(rest) == len(holders):
        raise ConfigError(f"{file}: nobody is named '{name}'")
    _write(file, rest)


def _write(file: Path, holders: tuple[Holder, ...]) -> None:
    with atomic_file(file) as out:
        os.fchmod(out.fileno(), 0o600)
        tomli_w.dump(_File(token=holders).model_dump(exclude_none=True), out)


def _digest(token: str) -> str:
    return hashlib.sha256(token.encode(errors="surrogateescape")).hexdigest()
