"""The file in which a daemon keeps its state: read at the start, put aside where it is refused."""

import contextlib
from pathlib import Path

from wetwell.protocols.errors import ConfigError


def read_kept(path: Path, setting: str) -> bytes | None:
    """What a file holds; None where there is none. Its folder is made.

    Raises
    ------
    ConfigError
        If the folder that the setting names cannot be used.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise ConfigError(f"{setting}: {path}: {error.strerror or error}") from error


def put_aside(path: Path) -> str:
    """Keep a file that is refused under another name, which is returned; a disk that refuses is passed over."""
    aside = path.with_suffix(".refused")
    with contextlib.suppress(OSError):
        path.replace(aside)
    return aside.name
