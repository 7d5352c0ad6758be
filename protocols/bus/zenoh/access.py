"""How a session on the bus shows who it is, and whom a router lets in."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from wetwell.protocols.bus.roles import AccessTable
from wetwell.protocols.errors import ConfigError

_TLS = "transport/link/tls"
_PASSWORD = "transport/auth/usrpwd"  # noqa: S105 - the name of a table


@dataclass(frozen=True, kw_only=True)
class ZenohAccess:
    """Who a session is, and for a router who may come and what they may do. Without anything: everybody, everything.

    Attributes
    ----------
    user, password : str, optional
        With which a client comes.
    users_file : Path, optional
        Lines `user:password` of those whom a router lets in.
    root_ca : Path, optional
        Certificate (PEM) of the authority that the certificates of the others must come from.
    certificate, private_key : Path, optional
        Own certificate and key (PEM): of a router always with `tls/`, of a client where the router asks for one.
    is_mutual : bool
        Whether a router asks each client for a certificate.
    verify_name : bool
        Whether a client holds the router's certificate against the address that it connects to.
    table : AccessTable, optional
        What a router lets whom do.
    """

    user: str | None = None
    password: str | None = field(default=None, repr=False)
    users_file: Path | None = None
    root_ca: Path | None = None
    certificate: Path | None = None
    private_key: Path | None = None
    is_mutual: bool = True
    verify_name: bool = True
    table: AccessTable | None = None

    @property
    def shown(self) -> str:
        """What a router may not like about a client; empty if it shows nothing."""
        parts = []
        if self.user is not None:
            parts.append(f"user '{self.user}' or the password")
        if self.root_ca is not None:
            parts.append("one of the certificates")
        return " or ".join(parts)

    def asks_who(self, endpoint: str) -> bool:
        """Whether a router with this access asks everybody who they are."""
        return self.users_file is not None or (endpoint.startswith("tls/") and self.is_mutual)

    def settings(self, mode: Literal["router", "client"], endpoint: str) -> dict[str, Any]:
        """Configuration of a Zenoh session, by path.

        Raises
        ------
        ConfigError
            If something is missing, or a file cannot be read.
        """
        self._check(mode, endpoint)
        found: dict[str, Any] = {}
        if endpoint.startswith("tls/"):
            found |= self._tls(mode)
        if mode == "router":
            if self.users_file is not None:
                found[f"{_PASSWORD}/dictionary_file"] = str(self.users_file)
            if self.table is not None:
                by_certificate = self.users_file is None
                found["access_control"] = self.table.zenoh_rules(by_certificate=by_certificate)
        if self.user is not None:
            found |= {f"{_PASSWORD}/user": self.user, f"{_PASSWORD}/password": self.password}
        return found

    def _tls(self, mode: Literal["router", "client"]) -> dict[str, Any]:
        side = "listen" if mode == "router" else "connect"
        found: dict[str, Any] = {f"{_TLS}/verify_name_on_connect": self.verify_name}
        if self.root_ca is not None:
            found[f"{_TLS}/root_ca_certificate"] = str(self.root_ca)
        if self.certificate is not None:
            found[f"{_TLS}/{side}_certificate"] = str(self.certificate)
            found[f"{_TLS}/{side}_private_key"] = str(self.private_key)
            found[f"{_TLS}/enable_mtls"] = self.is_mutual
        return found

    def _check(self, mode: Literal["router", "client"], endpoint: str) -> None:
        if (self.user is None) != (self.password is None):
            raise ConfigError("zenoh.user and zenoh.password or zenoh.password_file go together: one is missing")
        if (self.certificate is None) != (self.private_key is None):
            raise ConfigError("zenoh.tls.certificate and zenoh.tls.private_key go together: one is missing")
        if endpoint.startswith("tls/"):
            if mode == "router" and self.certificate is None:
                raise ConfigError(f"{endpoint}: a router needs zenoh.tls.certificate and zenoh.tls.private_key")
            if self.root_ca is None and (mode == "client" or self.is_mutual):
                raise ConfigError(f"{endpoint}: zenoh.tls.root_ca is missing: whose certificates are to be trusted?")
        if mode == "router" and self.table is not None and not self.asks_who(endpoint):
            raise ConfigError(
                "zenoh.access_control needs to know who comes: set zenoh.users_file, or zenoh.tls and a tls/ endpoint"
            )
        files = (self.users_file if mode == "router" else None, self.root_ca, self.certificate, self.private_key)
        for file in files:
            if file is not None:
                _check_readable(file)


def _check_readable(file: Path) -> None:
    try:
        with file.open("rb"):
            pass
    except OSError as error:
        raise ConfigError(f"{file}: cannot be read: {error.strerror}") from error


OPEN = ZenohAccess()
"""Everybody may come, and nobody shows who he is: for loopback."""
