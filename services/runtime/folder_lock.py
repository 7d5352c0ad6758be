"""A folder that one daemon of a kind may work in: a second of the same name is refused."""

import contextlib
import fcntl
from collections.abc import Iterator
from pathlib import Path

from wetwell.protocols.errors import ConfigError


@contextlib.contextmanager
def folder_held(folder: Path | None, setting: str, owner: str) -> Iterator[None]:
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
        yield
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
        yield
