"""Which kind of file an export is, by its name."""

from pathlib import Path

from wetwell.protocols.recordings.importers.mapping import TagMapping
from wetwell.protocols.recordings.importers.tables.block import ExportFile
from wetwell.protocols.recordings.importers.tables.excel_file import ExcelFile
from wetwell.protocols.recordings.importers.tables.parquet_file import ParquetFile
from wetwell.protocols.recordings.importers.tables.text_file import TextFile

_EXCEL = {".xlsx", ".xlsm", ".xlsb", ".xls", ".ods"}


def open_export(path: Path, mapping: TagMapping | None = None) -> ExportFile:
    """Export in a file: a workbook, Parquet, or else text.

    Parameters
    ----------
    path : Path
    mapping : TagMapping, optional
        What is known of it; without it all is found by looking.

    Raises
    ------
    RecordingError
        If it cannot be read, or has not the columns of the mapping.
    """
    suffix = path.suffix.lower()
    if suffix in _EXCEL:
        return ExcelFile(path, mapping)
    return ParquetFile(path, mapping) if suffix in {".parquet", ".pq"} else TextFile(path, mapping)
