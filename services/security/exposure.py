"""What may listen beyond this machine: only what asks who comes, unless the site says that it wants it open."""

import ipaddress
import logging

from wetwell.protocols.errors import ConfigError

log = logging.getLogger(__name__)


def is_loopback(host: str) -> bool:
    """Whether an address to listen on is reached from this machine only.

    Examples
    --------
    >>> [is_loopback(host) for host in ("127.0.0.1", "::1", "localhost", "0.0.0.0", "station7")]
    [True, True, True, False, False]
    """
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


def check_exposure(what: str, host: str, *, is_protected: bool, remedy: str, insecure: bool) -> None:
    """Refuse to listen on an address beyond this machine without protection.

    Parameters
    ----------
    what : str
        What listens, such as "dashboard".
    host : str
        Address to listen on.
    is_protected : bool
        Whether it asks everybody who they are.
    remedy : str
        What to set so that it does.
    insecure : bool
        The setting `security.insecure`: listen all the same, and warn.

    Raises
    ------
    ConfigError
        If it is to be refused; says what to do.
    """
    if is_loopback(host) or is_protected:
        return
    if not insecure:
        raise ConfigError(
            f"{what}: refuses to listen on {host}, where others reach it, without knowing who they are: set {remedy},"
            " listen on 127.0.0.1, or say security.insecure = true"
        )
    log.warning("%s listens on %s and lets in everybody who reaches it (security.insecure)", what, host)
