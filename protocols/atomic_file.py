"""Files that appear whole or not at all."""

import contextlib
import io
import os
from collections.abc import Iterator
from pathlib import Path

from wetwell.protocols.errors import RecordingError


@contextlib.contextmanager
def atomic_file(path: Path) -> Iterator[io.BufferedWriter]:
    """File to write; it gets its name when the block ends without an error, and is gone otherwise.

    Raises
    ------
    RecordingError
        If it cannot be written; names the file and the reason.
    """
    partial = path.with_name(f".{path.name}.part")
    try:
        with partial.open("wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())  # or a power failure could leave the name with nothing in it
        partial.replace(path)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            partial.unlink()
