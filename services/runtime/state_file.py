"""Where a daemon keeps its state: read at the start, written whole, put aside where it is refused."""

import contextlib
from pathlib import Path
from typing import Protocol

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import ConfigError


class StatePlace(Protocol):
    """A place for one state."""

    def read(self) -> bytes | None:
        """What was written last; None if there is nothing.

        Raises
        ------
        ConfigError
            If the place cannot be used.
        """

    def write(self, content: bytes) -> None:
        """Write a state in place of the last one, whole or not at all; from any thread.

        Raises
        ------
        RecordingError
            If it cannot be written.
        """

    def put_aside(self) -> str:
        """Keep what is refused under another name, which is returned."""


class FilePlace:
    """A file for one state.

    Parameters
    ----------
    path : Path
    setting : str
        That names its folder.
    """

    def __init__(self, path: Path, setting: str) -> None:
        self._path = path
        self._setting = setting

    def read(self) -> bytes | None:
        """What the file holds; None where there is none. Its folder is made.

        Raises
        ------
        ConfigError
            If the folder that the setting names cannot be used.
        """
        return read_kept(self._path, self._setting)

    def write(self, content: bytes) -> None:
        """Write the file.

        Raises
        ------
        RecordingError
            If the disk refuses.
        """
        with atomic_file(self._path) as file:
            file.write(content)

    def put_aside(self) -> str:
        """Keep the file under another name, which is returned."""
        return put_aside(self._path)


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
