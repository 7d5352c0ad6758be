"""TLS for servers of ours: who we are, and whose certificates clients must show."""

import logging
import ssl
from pathlib import Path

from wetwell.protocols.errors import ConfigError

log = logging.getLogger(__name__)


def server_context(certificate: Path, private_key: Path, client_ca: Path | None, what: str) -> ssl.SSLContext:
    """Context of a server, TLS 1.2 or later; a handshake that fails is logged.

    Parameters
    ----------
    certificate, private_key : Path
        Own chain and key, PEM.
    client_ca : Path, optional
        Authority (PEM) of which each client must show a certificate. Without it, all may come.
    what : str
        Name of the server in logs and errors.

    Raises
    ------
    ConfigError
        If a file cannot be read, or certificate and key do not belong together.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2

    class LoggedHandshake(ssl.SSLObject):
        """The end of a connection of which only the reason is known, if it fails: asyncio keeps it to itself."""

        def do_handshake(self) -> None:
            try:
                super().do_handshake()
            except (ssl.SSLWantReadError, ssl.SSLWantWriteError):
                raise
            except ssl.SSLError as error:
                log.warning(
                    "%s: a client is refused: %s", what, (error.reason or str(error)).lower().replace("_", " ")
                )
                raise

    context.sslobject_class = LoggedHandshake
    try:
        context.load_cert_chain(certificate, private_key)
        if client_ca is not None:
            context.load_verify_locations(client_ca)
            context.verify_mode = ssl.CERT_REQUIRED
    except ssl.SSLError as error:
        raise ConfigError(
            f"{what}: {certificate}, {private_key}: no certificate and key that fit: {error}"
        ) from error
    except OSError as error:
        files = [file for file in (certificate, private_key, client_ca) if file is not None and not file.is_file()]
        raise ConfigError(f"{what}: {', '.join(map(str, files))}: cannot be read: {error.strerror}") from error
    return context
