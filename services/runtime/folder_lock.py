"""A folder that one daemon of a kind may work in: a second of the same name is refused."""

import asyncio
import contextlib
import fcntl
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO

from wetwell.protocols.errors import ConfigError

CHECK_S = 10.0
"""Between two looks whether the folder that is held is still the one in its place. [s]"""


class Hold:
    """A folder that is held, or none: by its lock, which goes with it where a backup is put in its place.

    Parameters
    ----------
    file : file, optional
        The lock.
    place : str
        Setting and folder, for who is told.
    """

    def __init__(self, file: IO[str] | None, place: str) -> None:
        self._file = file
        self._path = None if file is None else Path(file.name)
        self._place = place

    @property
    def is_lost(self) -> bool:
        """Whether the lock is no longer in its place: whoever comes next holds another one."""
        if self._file is None or self._path is None:
            return False
        try:
            return not os.path.samestat(os.fstat(self._file.fileno()), self._path.stat())
        except FileNotFoundError:
            return True
        except OSError:
            return False  # the disk may answer again

    def check(self) -> None:
        """See whether the folder is still held.

        Raises
        ------
        ConfigError
            If it is lost.
        """
        if self.is_lost:
            raise ConfigError(f"{self._place}: its lock is gone: another folder, such as a backup, is in its place")

    async def watch(self) -> None:
        """Look for ever whether the folder is still held.

        Raises
        ------
        ConfigError
            Once it is lost.
        """
        await look_for_ever(self.check)


async def look_for_ever(check: Callable[[], None]) -> None:
    """Look each `CHECK_S` whether what is held is still held; what a look raises ends it."""
    while True:
        check()
        await asyncio.sleep(CHECK_S)


@contextlib.contextmanager
def folder_held(folder: Path | None, setting: str, owner: str) -> Iterator[Hold]:
    """Hold a folder until the block ends; the system lets go of it when the process dies. Without a folder nothing.

    Parameters
    ----------
    folder : Path, optional
        It is made if it is not there.
    setting : str
        That names it.
    owner : str
        Who holds it; others may work there too.

    Raises
    ------
    ConfigError
        If another holds it, or it cannot be held.
    """
    if folder is None:
        yield Hold(None, setting)
        return
    path = folder / f"{owner}.lock"
    with contextlib.ExitStack() as stack:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            file = stack.enter_context(path.open("w"))
        except OSError as error:
            raise ConfigError(f"{setting}: {path}: cannot be written: {error.strerror or error}") from error
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise ConfigError(f"{setting}: {folder}: another {owner} works here") from error
        yield Hold(file, f"{setting}: {folder}")
