"""Exports as Parquet."""

from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from wetwell.protocols.errors import RecordingError
from wetwell.protocols.recordings.importers.mapping import TagMapping
from wetwell.protocols.recordings.importers.refusals import Refusals
from wetwell.protocols.recordings.importers.tables.block import Block, ExportFile

_BLOCK_ROWS = 200_000


class ParquetFile(ExportFile):
    """A Parquet file."""

    def __init__(self, path: Path, mapping: TagMapping | None) -> None:
        self.path = path
        self.notes = ()
        self.assumed = {}
        self.decimal = (mapping.decimal if mapping else None) or "."
        try:
            path.open("rb").close()
            self._file = pa.parquet.ParquetFile(path)
            self.names = tuple(self._file.schema_arrow.names)
        except OSError as error:
            raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error
        except (pa.ArrowException, UnicodeDecodeError) as error:
            raise RecordingError(f"{path}: {str(error).splitlines()[0]}") from error
        if mapping and mapping.columns.time not in self.names:
            there = ", ".join(map(repr, self.names[:8]))
            raise RecordingError(f"{path}: columns.time: there is no '{mapping.columns.time}', there is {there}")

    def needed_bytes(self, signals: int) -> int:
        """Memory of stamps, lines and values, and once more while they are put in order. [B]."""
        return 2 * int(self._file.metadata.num_rows) * (24 + 9 * signals)

    def blocks(self, wanted: Collection[str], refusals: Refusals) -> Iterator[Block]:  # noqa: ARG002 - all rows are whole
        """Yield the rows with the wanted columns, as they are typed in the file.

        Raises
        ------
        RecordingError
            If the file cannot be read.
        """
        line = 1
        try:
            names = [name for name in self.names if name in wanted]
            for batch in self._file.iter_batches(_BLOCK_ROWS, columns=names, use_threads=False):
                columns = {name: batch.column(name) for name in names}
                yield Block(columns=columns, lines=np.arange(line, line + len(batch)))
                line += len(batch)
        except (pa.ArrowException, OSError) as error:
            raise RecordingError(f"{self.path}: {str(error).splitlines()[0]}") from error
